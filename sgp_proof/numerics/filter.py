"""Influence of the signal path: parameters of the reaction wheel from encoder positions.

Parametric regression with the complete ten-coefficient model, so that every error is one of the
filter. Compared on the same recordings: backward differences paired by index (the paper's finite
differences), central differences with the command averaged over two steps, and the weak form of
`sgp_ros.engine.windows`.

    python -m sgp_proof.numerics.filter --seeds 10
"""

from __future__ import annotations

import os

for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

import numpy as np

from sgp_proof.result_files import make_parser, write_result
from sgp_proof.streams.accuracy import events_of
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

DURATION_S = 20.0
SCORED = ('w1', 'w3', 'w5', 'w8', 'w9', 'w10')


def differences(recording, robot, *, is_central):
    """Return coefficients by least squares per axis on finite differences."""
    t = recording.stamps_ns * 1e-9
    step = float(np.median(np.diff(t)))
    q, m = recording.position, recording.command[:, 0]
    if is_central:
        v = (q[2:] - q[:-2]) / (2 * step)
        a = (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
        q, m = q[1:-1], 0.5 * (m[1:-1] + m[:-2])
    else:
        v = np.diff(q, axis=0) / step
        a = np.diff(v, axis=0) / step
        q, v, m = q[1:-1], v[:-1], m[1:-1]
    effort = np.column_stack([np.zeros_like(m), m])
    rows = robot.regressor(Motion(q, v, np.zeros_like(q), effort))
    w = np.zeros(rows.shape[2])
    for axis in range(2):
        used = np.any(rows[:, axis] != 0.0, axis=0)
        w[used] += np.linalg.lstsq(rows[:, axis][:, used], a[:, axis], rcond=None)[0]
    return dict(zip((c.name for c in robot.coefficients), w, strict=True))


def weak_form(recording, robot, window):
    """Return coefficients from the engine, with a window of that length [s]."""
    settings = {
        'model.method': 'PR', 'filter.window': window, 'filter.hop': window / 2,
        'buffer.budget': 2000, 'reorder_window': 0.0,
    }  # fmt: skip
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    replay(engine, events_of(recording), lambda _step: None)
    return {p.name: p.value for p in engine.parameters()}


METHODS = {
    'backward differences, paired by index': lambda r, b: differences(r, b, is_central=False),
    'central differences, command averaged': lambda r, b: differences(r, b, is_central=True),
    'weak form, window 0.04 s': lambda r, b: weak_form(r, b, 0.04),
    'weak form, window 0.1 s': lambda r, b: weak_form(r, b, 0.1),
    'weak form, window 0.2 s': lambda r, b: weak_form(r, b, 0.2),
}


def main() -> None:
    """Print and write the median relative error of each coefficient per method."""
    parser = make_parser(__doc__, 'filter')
    parser.add_argument('--seeds', type=int, default=10)
    arguments = parser.parse_args()
    robot = load_robot('reaction_wheel')
    errors = {name: [] for name in METHODS}
    for seed in range(arguments.seeds):
        recording = simulate(make_simulation('reaction_wheel', seed=seed), DURATION_S)
        truth = {k: v['value'] for k, v in recording.truth['coefficients'].items()}
        for name, method in METHODS.items():
            found = method(recording, robot)
            errors[name].append([abs(found[c] / truth[c] - 1.0) for c in SCORED])
    result = {
        'seeds': arguments.seeds,
        'duration_s': DURATION_S,
        'rate_hz': 100.0,
        'coefficients': list(SCORED),
        'median_relative_error': {
            name: [float(x) for x in np.median(rows, axis=0)] for name, rows in errors.items()
        },
    }
    write_result(arguments.out, result)
    print('median relative error [%] over', arguments.seeds, 'seeds')
    print(f'{"":40s}' + ''.join(f'{c:>9s}' for c in SCORED))
    for name, row in result['median_relative_error'].items():
        print(f'{name:40s}' + ''.join(f'{100 * x:9.2f}' for x in row))


if __name__ == '__main__':
    main()
