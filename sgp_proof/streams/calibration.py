"""Coverage of 95 % intervals of one-step predictions and parameters, over hundreds of worlds.

    python -m sgp_proof.streams.calibration [worlds|wheels|recordings ...]

`worlds` are draws from the model itself, a joint that comes back to where it was: hyper-parameters
known and learned, every way to keep the stream. `wheels` are simulated reaction wheels with
encoders through the whole engine, to a model that holds all of their physics. `recordings` are
the real ones, through the engine of `sgp replay` in both modes.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np

from sgp_proof.real.recordings import MACHINES
from sgp_proof.result_files import make_parser, read_result, write_result
from sgp_proof.streams.accuracy import events_of
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import learn
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

LENGTH, FIRST, BUDGET, FEATURES = 400, 100, 60, 60
WHEEL_S = 20.0
TRUE = Model((SquaredExponential(1.0, (0.5, 1.5), (0, 1)),), (0.05,))
PRIOR = CoefficientPrior.from_std(np.zeros(3), np.full(3, 2.0))
SETTLED = 100
"""Scored predictions of a recording before its coverage counts."""


def _world(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(LENGTH) * rng.uniform(0.15, 0.25) + rng.uniform(0.0, 6.0)
    U = np.stack([1.3 * np.sin(t), 2.0 * np.cos(t * np.sqrt(1.7))], axis=1)
    F = np.stack([U[:, 0], U[:, 1], rng.normal(size=LENGTH)], axis=1)[:, None]
    w = 2.0 * rng.normal(size=3)
    kernel = TRUE.kernels[0]
    directions = rng.normal(size=(2, 2000)) / np.array(kernel.lengthscales)[:, None]
    angle = U @ directions + rng.uniform(0.0, 2.0 * np.pi, size=2000)
    z = np.sqrt(2.0 * kernel.variance / 2000) * np.cos(angle).sum(axis=1)
    y = F[:, 0] @ w + z + np.sqrt(TRUE.noise[0]) * rng.standard_normal(LENGTH)
    return Observations(U, F, y[:, None]), w


def _ways(model):
    yield from (
        (
            f'exact, {policy}',
            OnlineRegression(model, PRIOR, Memory(BUDGET, features=FEATURES, policy=policy)),
        )
        for policy in ('oldest', 'least_informative', 'coverage')
    )
    yield 'basis', InducingPointRegression(model, PRIOR, Memory(BUDGET, FEATURES))


def _one_world(online, data, w):
    inside, losses = [], []
    for i, (u, f, y) in enumerate(zip(data.U, data.F, data.y, strict=True)):
        prediction = online.predict(u, f)
        variance = float(prediction.covariance[0, 0]) + online.model.noise[0]
        error = float(y[0] - prediction.mean[0])
        online.learn(prediction, y)
        if i >= FIRST:
            inside.append(abs(error) <= INTERVAL_95 * np.sqrt(variance))
            losses.append(0.5 * (np.log(2.0 * np.pi * variance) + error**2 / variance))
    information = online.information
    deviation = np.sqrt(np.diag(information.covariance))
    error = information.coefficients - w
    whitened = information.R @ error
    return (
        np.mean(inside), np.mean(losses), np.mean(np.abs(error) <= INTERVAL_95 * deviation),
        whitened @ whitened / len(w),
    )  # fmt: skip


def _worlds(seeds):
    found = {}
    for seed in seeds:
        data, w = _world(seed)
        head = Observations(data.U[:FIRST], data.F[:FIRST], data.y[:FIRST])
        learned = learn(head, PRIOR, TRUE).model
        for kind, model in (('known', TRUE), ('learned', learned)):
            for name, online in _ways(model):
                scores = _one_world(online, data, w)
                found.setdefault(f'{name}, {kind}', []).append(scores)
    names = ('coverage95', 'nlpd', 'w_coverage95', 'w_msq')
    return {
        way: dict(zip(names, np.mean(rows, axis=0).tolist(), strict=True)) | {'worlds': len(rows)}
        for way, rows in found.items()
    }


def _summary(estimates, engine):
    """Return coverage and NLPD of the target over all joints, once the model has settled."""
    channels = [getattr(e, engine.robot.target) for e in estimates if e.is_scored][SETTLED:]
    error = np.array([c.measured - c.mean for c in channels])
    variance = np.array([c.raw_variance for c in channels])
    return {
        'coverage95': np.mean(np.abs(error) <= INTERVAL_95 * np.sqrt(variance), axis=0).tolist(),
        'nlpd': np.mean(
            0.5 * (np.log(2.0 * np.pi * variance) + error**2 / variance), axis=0
        ).tolist(),
        'drifting': [test.is_drifting for test in engine.drift], 'n': len(channels),
    }  # fmt: skip


def _engine_run(robot, settings, events):
    engine, estimates = Engine(robot, EngineConfig.from_mapping(settings, robot)), []
    replay(engine, events, lambda step: estimates.extend(step.estimates))
    return _summary(estimates, engine), engine


def _wheels(seeds):
    robot = load_robot('reaction_wheel')
    found = {'exact': [], 'basis': []}
    for seed in seeds:
        run = simulate(
            make_simulation('reaction_wheel', seed=seed, controller='sinusoids', rate_hz=100.0,
                            start_ns=1), WHEEL_S)  # fmt: skip
        events = events_of(run)
        for mode, rows in found.items():
            rows.append(_engine_run(robot, {'buffer.mode': mode}, events)[0])
    return {
        mode: {
            'wheels': len(rows), 'joints': list(robot.joint_names),
            'coverage95': np.mean([row['coverage95'] for row in rows], axis=0).tolist(),
            'nlpd': np.mean([row['nlpd'] for row in rows], axis=0).tolist(),
            'drifting': np.mean([row['drifting'] for row in rows], axis=0).tolist(),
        }
        for mode, rows in found.items()
    }  # fmt: skip


def _recordings(_seeds):
    found = {}
    for name, case in MACHINES.items():
        if case.seconds is not None:
            continue  # too short to settle
        with tempfile.TemporaryDirectory() as folder:
            events = list(open_recording(case.bag(Path(folder))).events())
        robot, settings = case.load_robot(), load_parameters(case.params)
        settings = {k: v for k, v in settings.items() if k not in ('robot', 'command.type')}
        found[name] = {'joints': list(robot.joint_names)}
        for mode in ('exact', 'basis'):
            summary, _ = _engine_run(robot, {**settings, 'buffer.mode': mode}, events)
            found[name][mode] = summary
            print(name, mode, summary, flush=True)
    return found


PARTS = {'worlds': _worlds, 'wheels': _wheels, 'recordings': _recordings}


def main():
    """Run the named parts, or all, and write the result."""
    parser = make_parser(__doc__, 'calibration', PARTS)
    parser.add_argument('--seeds', type=int, default=200, help='of worlds and wheels')
    arguments = parser.parse_args()
    found = read_result(arguments.out)
    for name in arguments.names:
        found[name] = PARTS[name](range(arguments.seeds))
        print(name, json.dumps(found[name], indent=1), flush=True)
    result = {'length': LENGTH, 'budget': BUDGET, 'features': FEATURES, 'wheel_s': WHEEL_S}
    result |= {name: found[name] for name in PARTS if name in found}
    write_result(arguments.out, result)


if __name__ == '__main__':
    main()
