"""The monitor of the node: how often it alarms without cause, and how soon with one.

    python -m sgp_proof.streams.alarms

Simulated reaction wheels with encoders, through the whole engine in the settings of `config/`. An
undisturbed stretch counts false alarms, for several rates that are asked for; an alarm of any
joint counts. Then the motor loses a third of its gain for two seconds, again and again: the engine
is given a larger command than the wheel gets.

A rate of one an hour takes many hours to see. These are of linear axes whose motion and measured
effort are written down, so that an hour takes a minute: with cogging that the model lacks and Z
has to learn, noise and an encoder, each on a motion of its own, through the whole engine too.

What the monitor itself does on errors that are drawn, of several kinds: see `alarm_nulls`. Results
of schema 1 are of a monitor that took the lengths of excursions to be geometric.
"""

from __future__ import annotations

import json
import math

import numpy as np

from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_proof.streams.alarm_nulls import ASKED, LEAST_S
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.fit_health import FitHealth
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.sensors import Sensors

WARM_UP_S = 60.0
EVERY_S, LASTING_S, GAIN = 30.0, 2.0, 1.5
ROBOT = 'reaction_wheel'
AXIS, RATE_HZ, AXIS_H = 'linear_axis', 50.0, 2.0
"""Robot of the long streams, states a second, and hours of each."""


class Run:
    """One wheel, its engine, and a monitor for each rate that is asked for."""

    def __init__(self, seed):
        robot = load_robot(ROBOT)
        values = {**load_parameters(ROOT / 'config' / f'{ROBOT}.yaml'), 'refit.enabled': False}
        self._engine = Engine(robot, EngineConfig.from_mapping(values, robot))
        sensors = Sensors(resolution=(2.0 * math.pi / 4096,))
        self._simulation = make_simulation(ROBOT, seed=seed, sensors=sensors)
        self._robot = robot
        self.health = {x: FitHealth(len(robot.joints), LEAST_S, x) for x in ASKED}
        self.first_ns = None

    def step(self, is_disturbed):
        """Take one sample; return its time [s]."""
        sample = self._simulation.step()
        command = sample.command * (GAIN if is_disturbed else 1.0)
        events = (
            CommandSample(sample.stamp_ns, command, ('wheel',)),
            JointSample(sample.stamp_ns, self._simulation.joint_names, sample.position),
        )
        self.first_ns = sample.stamp_ns if self.first_ns is None else self.first_ns
        for event in events:
            estimates = self._engine.push(event).estimates
            for health in self.health.values():
                health.take(estimates, self._robot)
        return (sample.stamp_ns - self.first_ns) * 1e-9

    def alarms(self, asked):
        """Return the number of alarms so far, of all joints."""
        return alarms_of(self.health[asked])


def alarms_of(health):
    """Return the number of alarms of all joints."""
    return sum(monitor.alarms for monitor in health.monitors)


def axis_motion(rng, t):
    """Return position [m] and effort [N] of an axis on a sum of sines, at times t (n,) [s]."""
    rate, phase = 2.0 * np.pi * rng.uniform(0.1, 0.7, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    angle = t[:, None] * rate + phase
    q = 0.05 * np.sin(angle).sum(axis=1)
    v, a = 0.05 * np.cos(angle) @ rate, -0.05 * np.sin(angle) @ rate**2
    effort = 95.0 * a + 200.0 * v + 20.0 * np.tanh(v / 1e-3) + 5.0 * np.sin(60.0 * q)
    return np.round(q / 1e-6) * 1e-6, effort + 0.5 * rng.standard_normal(len(t))


def undisturbed(seed, hours):
    """Return false alarms of one axis by the rate asked for, after the warm-up."""
    robot, rng = load_robot(AXIS), np.random.default_rng(seed)
    values = {
        **load_parameters(ROOT / 'config' / f'{AXIS}.yaml'), 'refit.enabled': False,
        'filter.window': 0.2, 'filter.hop': 0.1, 'buffer.budget': 60,
    }  # fmt: skip
    engine = Engine(robot, EngineConfig.from_mapping(values, robot))
    health = {x: FitHealth(len(robot.joints), LEAST_S, x) for x in ASKED}
    t = np.arange(round((WARM_UP_S + 3600.0 * hours) * RATE_HZ)) / RATE_HZ
    before = dict.fromkeys(ASKED, 0)
    for now, q, effort in zip(t, *axis_motion(rng, t), strict=True):
        sample = JointSample(
            round(now * 1e9), robot.joint_names, frozen_array([q]), None, frozen_array([effort])
        )
        estimates = engine.push(sample).estimates
        for asked in ASKED:
            health[asked].take(estimates, robot)
            if now < WARM_UP_S:
                before[asked] = alarms_of(health[asked])
    return {asked: alarms_of(health[asked]) - before[asked] for asked in ASKED}


def long_streams(axes, hours):
    """Return false alarms by the rate asked for, of each axis and of all."""
    found = []
    for seed in range(axes):
        found.append(undisturbed(seed, hours))
        print(AXIS, seed, json.dumps(found[-1]), flush=True)
    return {
        'robot': AXIS, 'axes': axes, 'hours': axes * hours,
        'rates': {
            str(asked): {
                'false_alarms': [each[asked] for each in found],
                'false_an_hour': sum(each[asked] for each in found) / (axes * hours),
            }
            for asked in ASKED
        },
    }  # fmt: skip


def measure(seed, undisturbed_s, disturbed_s):
    """Return false alarms by the rate asked for, and the delays of alarms with a cause."""
    run, t = Run(seed), 0.0
    while t < WARM_UP_S:
        t = run.step(is_disturbed=False)
    before = {asked: run.alarms(asked) for asked in ASKED}
    while t < WARM_UP_S + undisturbed_s:
        t = run.step(is_disturbed=False)
    false = {asked: run.alarms(asked) - before[asked] for asked in ASKED}
    delays = {asked: [] for asked in ASKED}
    start = t
    while t < start + disturbed_s:
        began, seen = t, {asked: run.alarms(asked) for asked in ASKED}
        found = dict.fromkeys(ASKED)
        while t < began + EVERY_S:
            t = run.step(is_disturbed=t < began + LASTING_S)
            for asked in ASKED:
                if found[asked] is None and run.alarms(asked) > seen[asked]:
                    found[asked] = t - began
        for asked in ASKED:
            delays[asked].append(found[asked])
    return false, delays


def main():
    """Measure and write the result."""
    parser = make_parser(__doc__, 'alarms')
    parser.add_argument('--seeds', type=int, default=12)
    parser.add_argument('--minutes', type=float, default=10.0)
    parser.add_argument('--axes', type=int, default=12, help=f'long streams of {AXIS_H:g} h each')
    arguments = parser.parse_args()
    false, delays = dict.fromkeys(ASKED, 0), {asked: [] for asked in ASKED}
    for seed in range(arguments.seeds):
        found = measure(seed, 60.0 * arguments.minutes, 60.0 * arguments.minutes / 2.0)
        for asked in ASKED:
            false[asked] += found[0][asked]
            delays[asked] += found[1][asked]
        print(seed, json.dumps(false), flush=True)
    hours = arguments.seeds * arguments.minutes / 60.0
    result = {
        'robot': ROBOT, 'hours': hours, 'least_s': LEAST_S, 'gain_lost': 1.0 - 1.0 / GAIN,
        'lasting_s': LASTING_S,
        'rates': {
            str(asked): {
                'false_alarms': false[asked], 'false_an_hour': false[asked] / hours,
                **_detection(delays[asked]),
            }
            for asked in ASKED
        },
    }  # fmt: skip
    result['long'] = long_streams(arguments.axes, AXIS_H)
    write_result(arguments.out, result, schema=2)


def _detection(delays):
    """Return how many disturbances alarmed while they lasted, and their median delay [s]."""
    seen = sorted(x for x in delays if x is not None and x <= LASTING_S + LEAST_S)
    return {
        'disturbances': len(delays), 'detected': len(seen),
        'median_delay_s': seen[len(seen) // 2] if seen else None,
    }  # fmt: skip


if __name__ == '__main__':
    main()
