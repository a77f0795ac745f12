"""One-step predictions along streams, compared with other methods.

    python -m sgp_proof.streams.accuracy [NAME ...]

Every method sees the same equations of motion in the same order, predicts each before it learns
it, and is scored after the first ones, from which it learns its hyper-parameters, once. The batch
SGP is fitted anew to all that came before, ten times a stream: what a stream could reach at best.
"""

from __future__ import annotations

import itertools
import tempfile
import time
from pathlib import Path

import numpy as np

from sgp_proof.paper import arm
from sgp_proof.real.recordings import MACHINES
from sgp_proof.result_files import make_parser, read_result, write_result
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.prior_knowledge import prior_of_robot
from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.information import Information
from sgp_ros.gp.methods import METHODS, FitOptions
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.scores import coverage95, nlpd, nmse
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

BUDGET, FEATURES, RIVAL_FEATURES, REFITS = 300, 150, 200, 10
_GATHER = {'learning.initial': 100_000, 'refit.enabled': False}


def events_of(recording):
    """Return a simulated recording as events: each command, and the positions at that time."""
    events = []
    for stamp, position, command in zip(
        recording.stamps_ns, recording.position, recording.command, strict=True
    ):
        events.append(CommandSample(int(stamp), command))
        events.append(JointSample(int(stamp), recording.joint_names, position))
    return events


def _gathered(robot, settings, events):
    """Return the equations of motion that the engine makes of events."""
    engine = Engine(robot, EngineConfig.from_mapping({**settings, **_GATHER}, robot))
    for event in events:
        engine.push(event)
    engine.flush()
    U, F, y = (np.array(column) for column in zip(*engine.estimator.waiting, strict=True))
    return Observations(U, F, y)


def _reaction_wheel():
    """A hundred seconds of the simulated wheel, to a model without viscous friction."""
    recording = simulate(
        make_simulation(
            'reaction_wheel', seed=1, controller='sinusoids', rate_hz=100.0, start_ns=1
        ),
        100.0,
    )
    robot = load_robot('reaction_wheel_6')
    return robot, _gathered(robot, {}, events_of(recording)), 200


def _arm():
    """The arm of the paper on two horizontal figure-eights, then on a vertical one."""
    world = arm.make_world(0)
    parts = [world.train, *(world.tests[name].data for name in ('horizontal', 'vertical'))]
    data = Observations(*(np.concatenate([getattr(p, n) for p in parts]) for n in 'UFy'))
    return arm.make_robot(), data, 200


def _recorded(name):
    machine = MACHINES[name]
    robot, settings = machine.load_robot(), load_parameters(machine.params)
    with tempfile.TemporaryDirectory() as folder:
        events = open_recording(machine.bag(Path(folder))).events()
        return robot, _gathered(robot, settings, events), settings['learning.initial']


STREAMS = {
    'reaction_wheel': _reaction_wheel,
    'arm': _arm,
    'tiago': lambda: _recorded('tiago'),
    'panda': lambda: _recorded('panda'),
}


class IncrementalFeatures:
    """A rival without physics: incremental sparse spectrum Gaussian process regression.

    Gijsberts and Metta, Neural Networks 41, 2013: a process in random Fourier features (Rahimi and
    Recht 2007) whose weights are learned by recursive least squares. No Python library has it.

    Args:
        kernel: squared exponential.
        noise: variance.
        features: an even number.
        seed: of the frequencies.
    """

    def __init__(self, kernel, noise, features, seed):
        rng = np.random.default_rng(seed)
        self._kernel = kernel
        self._noise = noise
        self._frequencies = rng.normal(size=(len(kernel.inputs), features // 2))
        prior = CoefficientPrior.from_std(np.zeros(features), np.ones(features))
        self._information = Information.of_prior(prior)

    def _features(self, u):
        angle = self._kernel.scale(u[None])[0] @ self._frequencies
        scale = np.sqrt(self._kernel.variance / len(angle))
        return scale * np.concatenate([np.cos(angle), np.sin(angle)])

    def predict(self, u):
        """Return mean and variance of the observation at an input u (d,)."""
        phi = self._features(u)
        spread = self._information.spread(phi[None])[0]
        return float(phi @ self._information.coefficients), float(spread @ spread) + self._noise

    def learn(self, u, y):
        """Learn observation y at input u (d,)."""
        root = np.sqrt(self._noise)
        self._information.absorb(np.append(self._features(u), y)[None] / root)


class _Joint:
    """W and Z together, in one of the ways to keep a stream."""

    def __init__(self, online):
        self._online = online

    def take(self, u, f, y):
        """Predict, then learn; return mean and variance of the observation, (k,) each."""
        prediction = self._online.predict(u, f)
        self._online.learn(prediction, y)
        noise = np.array(self._online.model.noise)
        return prediction.mean, np.diag(prediction.covariance) + noise


class _Features:
    """Random features without physics, or on what physics leaves once it has settled."""

    def __init__(self, model, physics=None, settling=0):
        self._physics = physics
        self._left = settling
        self._parts = [
            IncrementalFeatures(kernel, noise, RIVAL_FEATURES, seed)
            for seed, (kernel, noise) in enumerate(zip(model.kernels, model.noise, strict=True))
        ]

    def take(self, u, f, y):
        """As `_Joint.take`; the variance is that of the features alone."""
        explained = np.zeros(len(y)) if self._physics is None else self._physics.take(u, f, y)[0]
        found = np.array([part.predict(u) for part in self._parts])
        self._left -= 1
        if self._left < 0:
            for part, value in zip(self._parts, y - explained, strict=True):
                part.learn(u, value)
        return explained + found[:, 0], found[:, 1]


def _methods(data, prior, inputs, every, first):
    """Return every method with hyper-parameters learned from the first equations.

    Without physics a process needs every input; beside physics it sees those of the robot.
    """
    head = Observations(data.U[:first], data.F[:first], data.y[:first])
    fits = {
        name: fit(head, prior, every if name == 'GP' else inputs, FitOptions())
        for name, fit in METHODS.items()
    }
    sgp_model, plain = fits['SGP'].model, fits['PR'].model

    def physics():
        return _Joint(OnlineRegression(plain, prior, Memory(1)))

    methods = {
        'RLS, physics alone': physics(),
        'ISSGPR, no physics': _Features(fits['GP'].model),
        'RLS, then ISSGPR': _Features(fits['PRGP'].model, physics(), first),
    }
    for policy in ('oldest', 'least_informative', 'coverage'):
        online = OnlineRegression(
            sgp_model, prior, Memory(BUDGET, features=FEATURES, policy=policy)
        )
        methods[f'SGP, exact, {policy}'] = _Joint(online)
    methods['SGP, basis'] = _Joint(
        InducingPointRegression(sgp_model, prior, Memory(BUDGET, FEATURES))
    )
    return methods, sgp_model


def _scores(y, mean, variance):
    usable = np.all(np.isfinite(variance), axis=1) & np.all(variance > 0.0, axis=1)
    y, mean, variance = y[usable], mean[usable], variance[usable]
    return {
        'nmse': nmse(y, mean).tolist(), 'nlpd': nlpd(y, mean, variance).tolist(),
        'coverage95': coverage95(y, mean, variance).tolist(), 'scored': int(usable.sum()),
    }  # fmt: skip


def _along(method, data, first):
    """Return the scores of one method on one stream, and its time per sample."""
    began = time.thread_time()
    found = [method.take(u, f, y) for u, f, y in zip(data.U, data.F, data.y, strict=True)]
    duration = time.thread_time() - began
    mean, variance = (np.array([pair[i] for pair in found])[first:] for i in (0, 1))
    return _scores(data.y[first:], mean, variance) | {'us': 1e6 * duration / len(data.y)}


def _batch(model: Model, data, prior, first):
    """Return the scores of a batch fit to all that came before, of each tenth of the stream."""
    borders = np.linspace(first, len(data.y), REFITS + 1).astype(int)
    means, variances = [], []
    for start, stop in itertools.pairwise(borders):
        head = Observations(data.U[:start], data.F[:start], data.y[:start])
        found = Posterior(model, head, prior).predict(data.U[start:stop], data.F[start:stop])
        found = found.observed(np.array(model.noise))
        means.append(found.mean)
        variances.append(np.einsum('nkk->nk', found.covariance))
    return _scores(data.y[first:], np.concatenate(means), np.concatenate(variances))


def _run(name):
    robot, data, first = STREAMS[name]()
    config = EngineConfig.from_mapping({}, robot)
    prior = prior_of_robot(robot, config)
    inputs = robot.residual_columns(('default',))
    every = robot.residual_columns(('all',))
    methods, model = _methods(data, prior, inputs, every, first)
    found = {title: _along(method, data, first) for title, method in methods.items()}
    found['SGP, batch'] = _batch(model, data, prior, first)
    for title, scores in found.items():
        print(name, title, {k: float(np.mean(v)) for k, v in scores.items()}, flush=True)
    return {
        'equations': len(data.y), 'first': first, 'joints': list(robot.joint_names),
        'coefficients': data.F.shape[2], 'methods': found,
    }  # fmt: skip


def main():
    """Run the named streams, or all, and write the result."""
    arguments = make_parser(__doc__, 'stream_accuracy', STREAMS).parse_args()
    found = read_result(arguments.out).get('streams', {})
    for name in arguments.names:
        found[name] = _run(name)
        result = {
            'budget': BUDGET, 'features': FEATURES, 'rival_features': RIVAL_FEATURES,
            'streams': {name: found[name] for name in STREAMS if name in found},
        }  # fmt: skip
        write_result(arguments.out, result)


if __name__ == '__main__':
    main()
