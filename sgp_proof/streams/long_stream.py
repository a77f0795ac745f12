"""A stream of 200 000 samples: time and memory per sample, errors, and how certain W becomes.

    python -m sgp_proof.streams.long_stream

The truth is a draw from the model: W normal, Z a draw of its kernel over position and velocity, so
intervals can be checked. The joint follows three sines whose periods have no common multiple,
and comes back to where it was again and again. Beside the ways to keep a stream stands a batch
fit on a random subset as large as the buffer. Hyper-parameters are learned from the first samples
once, for all. Times are those of the processor, not of the wall.
"""

from __future__ import annotations

import gc
import resource
import time
from pathlib import Path

import numpy as np

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.scores import RunningScore

BLOCK, FIRST, BUDGET, FEATURES, QUERIES = 20_000, 400, 300, 150, 1000
RATE_HZ = 100.0
NOISE = 0.1
PRIOR = CoefficientPrior.from_std(np.zeros(4), np.full(4, 10.0))
ROOM = 3 * BLOCK


class World:
    """A joint with four coefficients and one function of position and velocity."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.w = rng.normal(size=4) * [1.0, 1.0, 1.0, 2.0]
        self._directions = rng.normal(size=(2, 1000)) / np.array([[0.7], [1.5]])
        self._phases = rng.uniform(0.0, 2.0 * np.pi, size=1000)
        self._periods = np.array([3.1, 4.7 * np.sqrt(2.0), 1.9 * np.sqrt(3.0)])
        self._start = rng.uniform(0.0, 2.0 * np.pi, size=3)
        self._rng = rng

    def samples(self, first, count):
        """Return inputs, regressors, observations and truths of consecutive samples."""
        t = np.arange(first, first + count)[:, None] / RATE_HZ * 20.0
        rate = 2.0 * np.pi / self._periods
        angle = t * rate + self._start
        q, v = np.sin(angle).sum(axis=1) / 2.0, (np.cos(angle) * rate).sum(axis=1) / 2.0
        a = (-np.sin(angle) * rate**2).sum(axis=1) / 2.0
        U = np.stack([q, v], axis=1)
        F = np.stack([a, np.sin(q), v, np.tanh(v / 0.2)], axis=1)[:, None]
        z = np.sqrt(2.0 / 1000) * np.cos(U @ self._directions + self._phases).sum(axis=1)
        truth = F[:, 0] @ self.w + z
        y = truth + NOISE * self._rng.standard_normal(count)
        return U, F, y[:, None], truth


def _model(world):
    U, F, y, _ = world.samples(0, FIRST)
    data = Observations(U, F, y)
    start = screened(data, PRIOR, initial_model(data, ((0, 1),)))
    return learn(data, PRIOR, start, 1, np.random.default_rng(0)).model


def _resident_mb():
    gc.collect()
    pages = int(Path('/proc/self/statm').read_text(encoding='utf-8').split()[1])
    return pages * resource.getpagesize() / 1e6


def _ways(model):
    ways = {
        f'exact, {policy}': lambda policy=policy: OnlineRegression(
            model, PRIOR, Memory(BUDGET, features=FEATURES, policy=policy)
        )
        for policy in ('oldest', 'least_informative', 'coverage')
    }
    return ways | {
        'basis': lambda: InducingPointRegression(model, PRIOR, Memory(BUDGET, FEATURES))
    }


def _stream(online, world, queries, samples):
    found = {name: [] for name in ('us_p50', 'us_p99', 'resident_mb', 'nmse', 'w_msq')}
    score = RunningScore()
    noise = online.model.noise[0]
    for first in range(0, samples, BLOCK):
        U, F, y, _ = world.samples(first, BLOCK)
        durations = np.empty(BLOCK)
        for i in range(BLOCK):
            began = time.thread_time()
            prediction = online.predict(U[i], F[i])
            online.learn(prediction, y[i])
            durations[i] = time.thread_time() - began
            variance = float(prediction.covariance[0, 0]) + noise
            if first + i >= FIRST:
                score.add(float(y[i, 0]), float(prediction.mean[0]), variance)
        found['us_p50'].append(1e6 * float(np.median(durations)))
        found['us_p99'].append(1e6 * float(np.percentile(durations, 99)))
        found['resident_mb'].append(_resident_mb())
        found['nmse'].append(_error(online, queries))
        information = online.information
        error = information.R @ (information.coefficients - world.w)
        found['w_msq'].append(float(error @ error) / len(error))
    return found | {'coverage95': score.coverage95, 'nlpd': score.nlpd}


def _error(online, queries):
    U, F, truth = queries
    means = np.array([online.predict(u, f).mean[0] for u, f in zip(U, F, strict=True)])
    return float(np.mean((means - truth) ** 2) / truth.var())


def _subset(model, world, queries, size, samples):
    """Return the error of batch fits on random subsets of the same stream."""
    errors = []
    U, F, y, _ = world.samples(0, samples)
    for seed in range(5):
        chosen = np.random.default_rng(seed).choice(samples, size, replace=False)
        posterior = Posterior(model, Observations(U[chosen], F[chosen], y[chosen]), PRIOR)
        means = posterior.predict(queries[0], queries[1]).mean[:, 0]
        errors.append(float(np.mean((means - queries[2]) ** 2) / queries[2].var()))
    return errors


def main():
    """Run every way on the same stream and write the result."""
    parser = make_parser(__doc__, 'long_stream')
    parser.add_argument('--samples', type=int, default=200_000, help=f'a multiple of {BLOCK}')
    arguments = parser.parse_args()
    samples, model = arguments.samples, _model(World(0))
    U, F, _, truth = World(0).samples(samples + ROOM, QUERIES * 10)
    queries = (U[::10], F[::10], truth[::10])
    result = {
        'samples': samples, 'block': BLOCK,
        'budget': BUDGET, 'features': FEATURES, 'ways': {}, 'noise_variance': model.noise[0],
        'lengthscales': list(model.kernels[0].lengthscales),
        'random_subset_nmse': _subset(model, World(0), queries, BUDGET, samples),
    }  # fmt: skip
    for name, make in _ways(model).items():
        online = make()
        found = _stream(online, World(0), queries, samples)
        if name == 'basis':
            found |= {'features': list(online.features), 'unresolved': online.unresolved}
        result['ways'][name] = found
        print(name, {key: value[-1] if isinstance(value, list) else value
                     for key, value in found.items()}, flush=True)  # fmt: skip
    write_result(arguments.out, result)


if __name__ == '__main__':
    main()
