"""Intervals, Z and accelerations of real recordings, as a node predicts them, live and frozen.

    python -m sgp_proof.real.coverage [NAME ...]

Each recording passes the engine of `sgp replay` with its shipped settings. Live, the model learns
all the way. Frozen, it learns the first half of the recording and only predicts the second; where
no model exists by then, it learns half of what it predicts live. The width of the calibrated
intervals stands beside the narrowest constant width that would have held 95 % of the same errors,
fitted afterwards. Measured efforts go on adapting the intervals and the weight of Z of a frozen
model, which is the default of the settings; nothing else of it changes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from sgp_proof.real.recordings import MACHINES
from sgp_proof.result_files import make_parser, read_result, write_result
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.recordings.reader import open_recording

NODE_SETTINGS = ('robot', 'command.type')
FROZEN = {'learning.enabled': False, 'refit.enabled': False}


def _estimates(engine, events):
    found = []
    replay(engine, events, lambda step: found.extend(step.estimates))
    return [estimate for estimate in found if estimate.is_scored]


def _engine(case):
    robot = case.load_robot()
    settings = load_parameters(case.params)
    settings = {name: v for name, v in settings.items() if name not in NODE_SETTINGS}
    return Engine(robot, EngineConfig.from_mapping(settings, robot))


def _freeze_ns(events, live):
    """Return where learning ends [ns]."""
    first, last = events[0].stamp_ns, events[-1].stamp_ns
    half, begin = (first + last) // 2, live[0].stamp_ns
    return half if begin < half else (begin + last) // 2


def _channel(estimates, name, j):
    """Return the scores of one channel of one joint; None where nothing is predicted."""
    channels = [getattr(estimate, name) for estimate in estimates]
    measured, mean, variance, raw = (
        np.array([getattr(channel, part)[j] for channel in channels])
        for part in ('measured', 'mean', 'variance', 'raw_variance')
    )
    known = np.isfinite(mean) & (raw > 0.0)
    if not known.any() or np.ptp(measured[known]) == 0.0:
        return None
    error = np.abs(measured - mean)[known]
    width, raw_width = (INTERVAL_95 * np.sqrt(v[known]) for v in (variance, raw))
    constant = float(np.quantile(error, 0.95, method='higher'))
    return {
        'n': int(known.sum()),
        'nmse': float(np.mean(error**2) / np.var(measured[known])),
        'coverage95': float(np.mean(error <= width)),
        'raw_coverage95': float(np.mean(error <= raw_width)),
        'width_ratio': float(width.mean() / constant),
        'raw_width_ratio': float(raw_width.mean() / constant),
    }


def _joints(engine, estimates):
    alone, weights = engine.baseline_scores(), engine.process_weights()
    found = {}
    for j, joint in enumerate(engine.robot.joint_names):
        channels = {name: _channel(estimates, name, j) for name in ('effort', 'acceleration')}
        found[joint] = {name: score for name, score in channels.items() if score is not None}
        score = alone[joint].get(engine.robot.target)
        if score is not None:
            found[joint]['physics_alone'] = score.nmse
            found[joint]['process_weight'] = weights[joint].mean
    return found


def _run(case):
    with tempfile.TemporaryDirectory() as folder:
        events = list(open_recording(case.bag(Path(folder))).events())
    engine = _engine(case)
    live = _estimates(engine, events)
    found = {'target': engine.robot.target, 'live': _joints(engine, live)}
    freeze = _freeze_ns(events, live)
    engine = _engine(case)
    _estimates(engine, [event for event in events if event.stamp_ns <= freeze])
    engine.change(FROZEN)
    engine.begin_stream()
    rest = _estimates(engine, [event for event in events if event.stamp_ns > freeze])
    return found | {'frozen': _joints(engine, rest)}


def main():
    """Run the named recordings, or all, and write the result."""
    arguments = make_parser(__doc__, 'coverage', MACHINES).parse_args()
    found = read_result(arguments.out).get('recordings', {})
    for name in arguments.names:
        found[name] = _run(MACHINES[name])
    recordings = {name: found[name] for name in MACHINES if name in found}
    write_result(arguments.out, {'recordings': recordings})


if __name__ == '__main__':
    main()
