"""Residuals of the physics of real arms: noise, structure, and what Z can learn of them.

    python -m sgp_proof.real.residuals

* How the held-out error depends on the cut-off and on how far the rows stand apart.
* Half the mean square of what differs between two passes over the same path (Panda): no function
  of the state predicts better, since it says the same of both passes.
* Half the mean square of what differs between a row and its nearest neighbour at another time,
  over the variance: 1 for noise, less for a function of these states (gamma test of Evans and
  Jones 2002).
* Sets of inputs of Z by their error on held-out stretches of the training rows, where the motion
  is new, and on the held-out rows of the benchmark.
* One session beside another (EMPS): coefficients, and squared errors over their variances.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import spatial

from sgp_proof.real.recordings import DATA, ROBOTS, imported
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.apps.identify import IdentifyOptions, read_signals
from sgp_ros.batch.blocks import holdout
from sgp_ros.batch.fit import OfflineOptions, fit_offline
from sgp_ros.batch.regression_data import FilterPlan, filtered_data
from sgp_ros.robots.registry import load_robot

SPACINGS = {'white': 0.55, 'dense': 0.25}
"""Distance of the rows in periods of the cut-off: white noise is white again, or half of that."""
INPUTS = {
    'no Z': (),
    'own direction': ('own:direction',),
    'own velocity, direction': ('own:velocity', 'own:direction'),
    'own position, direction': ('own:position', 'own:direction'),
    'own position, velocity, direction': ('own:position', 'own:velocity', 'own:direction'),
    'velocities of all joints': ('every:velocity',),
    'directions of all joints': ('every:direction',),
}
_OPTIONS = OfflineOptions(max_points=300, max_basis=200)
_FOLDS, _STRETCHES, _APART_S = 4, 3, 1.0
_PASS_RATE = 5


@dataclass(frozen=True)
class Arm:
    """A recording as `sgp_proof.real.identified` scores it, and the filter chosen there."""

    robot: str
    cutoffs: tuple[float, ...]
    holdout: tuple[str, float, float]
    velocity: str
    chosen: float


ARMS = {
    'panda': Arm('panda.yaml', (2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0),
                 ('tail', 0.4, 6.0), 'measured', 11.0),
    'tiago': Arm('tiago_arm.yaml', (2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0),
                 ('alternate', 0.5, 6.0), 'position', 16.0),
}  # fmt: skip


def _filtered(signals, robot, cutoff, velocity, spacing=0.55, decimation=None):
    step = decimation or max(1, round(spacing * signals.rate / cutoff))
    plan = FilterPlan(cutoff, min(5.0 * cutoff, 0.4 * signals.rate), step, velocity)
    return filtered_data(signals, robot, plan)


def _nmse(error, y):
    squares = (error**2).mean(axis=0)
    return {
        'joints': (squares / y.var(axis=0)).tolist(),
        'mean': float((squares / y.var(axis=0)).mean()),
        'stacked': float(squares.sum() / y.var(axis=0).sum()),
    }


def _error(train, held, robot, method='PR', inputs=None):
    return fit_offline(train, robot, method, inputs, _OPTIONS).predict(held)[0] - held.y


def _cutoffs(arm, signals, robot):
    rows = []
    for cutoff in arm.cutoffs:
        for name, spacing in SPACINGS.items():
            data = _filtered(signals, robot, cutoff, arm.velocity, spacing)
            train, held = holdout(data, *arm.holdout)
            score = _nmse(_error(train, held, robot), held.y)
            rows.append({'cutoff_hz': cutoff, 'rows': name, 'rate_hz': data.rate} | score)
    return rows


def _noise_share(arm, signals, robot):
    """The gamma test on the residual of the physics, per joint and set of states."""
    data = _filtered(signals, robot, arm.chosen, arm.velocity)
    residual = -_error(data, data, robot)
    k = residual.shape[1]
    states = data.U[:, : 2 * k]
    shares, distances = {'own': [], 'all': []}, {'own': [], 'all': []}
    near_in_time = np.abs(data.time[:, None] - data.time) < _APART_S
    for j in range(k):
        for name, seen in (('own', states[:, [j, k + j]]), ('all', states)):
            u = seen / seen.std(axis=0)
            distance = spatial.distance.cdist(u, u)
            distance[near_in_time] = np.inf
            differs = residual[:, j] - residual[distance.argmin(axis=1), j]
            shares[name].append(float(0.5 * (differs**2).mean() / residual[:, j].var()))
            distances[name].append(float(np.median(distance.min(axis=1))))
    return {'share': shares, 'median_distance': distances}


def _inputs(arm, signals, robot):
    data = _filtered(signals, robot, arm.chosen, arm.velocity)
    train, held = holdout(data, *arm.holdout)
    stretch = np.arange(len(train.time)) * (_FOLDS * _STRETCHES) // len(train.time)
    found = {}
    for name, spec in INPUTS.items():
        inputs = robot.residual_columns(spec) if spec else (None,) * len(robot.joints)
        error = np.zeros_like(train.y)
        for fold in range(_FOLDS):
            is_held = stretch % _FOLDS == fold
            error[is_held] = _error(
                train.rows(~is_held), train.rows(is_held), robot, 'SGP', inputs
            )
        outer = _nmse(_error(train, held, robot, 'SGP', inputs), held.y)
        found[name] = {'new_motion': _nmse(error, train.y), 'held_out': outer}
        print(name, *(f'{key} {x["mean"]:.5f}' for key, x in found[name].items()), flush=True)
    return found


def _passes(arm, signals, robot):
    """The part of the held-out error that two passes over one path do not share."""
    data = _filtered(signals, robot, arm.chosen, arm.velocity, decimation=_PASS_RATE)
    q, n = data.motion.position, len(data.time)
    lags = range(n // 2, n - n // 4)
    lag = min(lags, key=lambda x: float(((q[x:] - q[:-x]) ** 2).mean()))
    train, _ = holdout(data, *arm.holdout)
    w = fit_offline(train.thinned(11), robot, 'PR').coefficients.mean
    left = data.y - data.F @ w
    second, differs = left[lag:], left[lag:] - left[:-lag]
    return {
        'period_s': lag / data.rate,
        'pairs_s': (n - lag) / data.rate,
        'largest_distance_rad': float(np.abs(q[lag:] - q[:-lag]).max()),
        'physics': _nmse(second, data.y[lag:]),
        'not_repeatable': _nmse(np.sqrt(0.5) * differs, data.y[lag:]),
    }


def _sessions(folder):
    """EMPS: the physics of each record, and calibration inside one and on the other."""
    robot, data = load_robot('linear_axis'), {}
    for name in ('emps_id', 'emps_val_pulses'):
        bag = str(imported(f'emps/{name}.csv', 'emps', folder))
        signals = read_signals(bag, robot, IdentifyOptions(), [])
        data[name] = _filtered(signals, robot, 22.0, 'position')
    fits = {name: fit_offline(d, robot, 'PR').coefficients for name, d in data.items()}
    for name, whole in data.items():  # a control: what changes inside one record
        first = np.arange(len(whole.time)) < len(whole.time) // 2
        for half, rows in (('first half', first), ('second half', ~first)):
            found = fit_offline(whole.rows(rows), robot, 'PR').coefficients
            fits[f'{name}, {half}'] = found
    sets = {name: spec for name, spec in INPUTS.items() if 'all joints' not in name}
    return {
        'coefficients': {
            name: {
                c: {'value': float(w), 'std': float(s)}
                for c, w, s in zip(f.names, f.mean, f.std, strict=True)
            }
            for name, f in fits.items()
        },
        'calibration': {
            name: _calibration(robot, spec, *data.values()) for name, spec in sets.items()
        },
    }


def _calibration(robot, spec, one, other):
    """Squared errors over variances inside a record and on another, and coverage there.

    `widened` is the coverage when variances grow by what the record shows of itself.
    """
    inputs = robot.residual_columns(spec) if spec else (None,)
    stretch = np.arange(len(one.time)) * (_FOLDS * _STRETCHES) // len(one.time)
    squares = []
    for fold in range(_FOLDS):
        held = one.rows(stretch % _FOLDS == fold)
        fit = fit_offline(one.rows(stretch % _FOLDS != fold), robot, 'SGP', inputs, _OPTIONS)
        mean, variance = fit.predict(held)
        squares.append((mean - held.y) ** 2 / variance)
    inside = float(np.concatenate(squares).mean())
    mean, variance = fit_offline(one, robot, 'SGP', inputs).predict(other)
    ratio = (mean - other.y) ** 2 / variance
    return {
        'inside': inside,
        'outside': float(ratio.mean()),
        'coverage95': float((ratio < 1.96**2).mean()),
        'widened': float((ratio < 1.96**2 * max(inside, 1.0)).mean()),
    }


def main() -> None:
    """Measure all and write the result."""
    arguments = make_parser(__doc__, 'residuals').parse_args()
    arms = {}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        sessions = _sessions(place)
        panda = str(imported('panda/panda_exciting.npz', 'panda', place))
        bags = {'panda': panda, 'tiago': str(DATA / 'tiago' / 'mcap_tiago_dynamic')}
        for name, arm in ARMS.items():
            robot = load_robot(str(ROBOTS / arm.robot))
            signals = read_signals(bags[name], robot, IdentifyOptions(), [])
            arms[name] = {
                'joints': list(robot.joint_names),
                'chosen_cutoff_hz': arm.chosen,
                'cutoffs': _cutoffs(arm, signals, robot),
                'noise_share': _noise_share(arm, signals, robot),
                'inputs': _inputs(arm, signals, robot),
            }
            if name == 'panda':
                arms[name]['passes'] = _passes(arm, signals, robot)
    write_result(arguments.out, {'arms': arms, 'emps_sessions': sessions})


if __name__ == '__main__':
    main()
