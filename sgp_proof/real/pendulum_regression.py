"""Regression on accelerations of real pendulums, compared with roll-outs.

    python -m sgp_proof.real.pendulum_regression

* Coefficients from the online filter with windows from short to long. Noise in the acceleration
  pulls those of the inverse model towards zero. The forward model has that noise in its target,
  where it does no harm, and the noise of the torque among its columns, which pulls 1/J towards
  zero and J up: the two enclose the truth as long as nothing else is wrong (Frisch 1934).
* PR, GP, PRGP and SGP of the simple pendulum side by side, as `sgp identify` compares them, for
  both targets, near and far from what was learned.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from sgp_proof.columns import constant, direction, sine, single_column, velocity
from sgp_proof.real.recordings import DOUBLE, SIMPLE, UNDISTURBED_S, cut_bag, imported
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.apps.identify import IdentifyOptions, read_signals
from sgp_ros.batch.identification import IdentificationOptions, identify
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.findings import collect_findings
from sgp_ros.report.metrics import Timing, collect_metrics
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

SIMPLE_PENDULUM = load_robot('simple_pendulum')
DOUBLE_PENDULUM = load_robot('double_pendulum')

DOUBLES = {
    f'{design[:3]} run {run}': DOUBLE.format(design, run)
    for design in ('A.0__20220815', 'C.0__20220914')
    for run in ('00', '01', '12')
}
WINDOWS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)
HOP = 0.05


def _effort(motion):
    return motion.effort[:, 0]


def _negative(signal):
    return lambda motion: -signal(motion)


FORWARD = Robot(
    name='simple_pendulum_forward',
    joints=(Joint('pendulum'),),
    target='acceleration',
    terms=tuple(
        single_column(
            Coefficient(name, unit, 'pendulum'), 0, signal, SIMPLE_PENDULUM.terms[0].source
        )
        for name, unit, signal in (
            ('1/J', '1/(kg m^2)', _effort),
            ('G/J', '1/s^2', _negative(sine(0))),
            ('Fv/J', '1/s', _negative(velocity(0))),
            ('Fc/J', '1/s^2', _negative(direction(0))),
            ('offset/J', '1/s^2', _negative(constant)),
        )
    ),
    residual_inputs=SIMPLE_PENDULUM.residual_inputs,
)
"""`a = effort / J - (G sin(q) + Fv v + Fc sign(v) + offset) / J`, linear in other coefficients."""


def _online(robot, events, window, velocity_source):
    """Coefficients and scores of the physics alone, as the node would find them."""
    settings = {
        'filter.window': window, 'filter.hop': HOP, 'filter.velocity': velocity_source,
        'model.method': 'PR', 'learning.initial': 20,
    }  # fmt: skip
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    replay(engine, events, lambda _step: None, obey_record=False)
    metrics = collect_metrics(engine, robot.name, timing=Timing())
    return {
        'parameters': {p['name']: p['value'] for p in metrics['parameters']},
        'nmse': {
            joint: {channel: score['nmse'] for channel, score in channels.items()}
            for joint, channels in metrics['joints'].items()
        },
    }


def _windows(robot, bag, velocity_source='position'):
    events = list(open_recording(bag).events())
    return {f'{window:g}': _online(robot, events, window, velocity_source) for window in WINDOWS}


def _methods(robot, bags):
    """Scores of every method: light records on each other, the heavy one on its end."""
    signals = {
        name: read_signals(str(b), robot, IdentifyOptions(), []) for name, b in bags.items()
    }
    light = ('energy_shaping', 'sac')
    pairs = [(light, {'sac': signals['sac']}), (light[::-1], {light[0]: signals[light[0]]})]
    found = {}
    for (name, _), tests in [*pairs, (('energy_shaping_1kg', ''), {})]:
        result = identify(signals[name], robot, tests, IdentificationOptions())
        findings = collect_findings(result, name, {}, {})
        found[name] = {key: findings[key] for key in ('held_out', 'filter', 'rows', 'scores')}
    return found


def main() -> None:
    """Measure all and write the result."""
    arguments = make_parser(__doc__, 'pendulum_regression').parse_args()
    windows, methods = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, file in DOUBLES.items():
            bag = imported(file, 'dfki_double_pendulum', place)
            windows[name] = {'inverse': _windows(DOUBLE_PENDULUM, bag)}
        bags = {}
        for name, seconds in UNDISTURBED_S.items():
            bag = imported(SIMPLE.format(name), 'dfki_simple_pendulum', place)
            bags[name] = cut_bag(bag, seconds)
            windows[name] = {
                'inverse': _windows(SIMPLE_PENDULUM, bags[name]),
                'inverse, measured velocity': _windows(SIMPLE_PENDULUM, bags[name], 'measured'),
                'forward': _windows(FORWARD, bags[name]),
            }
        for robot in (SIMPLE_PENDULUM, FORWARD):
            methods[robot.target] = _methods(robot, bags)
    write_result(arguments.out, {'windows': windows, 'methods': methods})


if __name__ == '__main__':
    main()
