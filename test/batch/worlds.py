"""Recordings whose truth is known, as events in the order of their stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import signal

from sgp_proof.columns import acceleration, single_column
from sgp_ros.batch.signals import Signals, collect_signals
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.recordings.table_map import read_map
from sgp_ros.recordings.tables import read_table
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

LINEAR_AXIS = load_robot('linear_axis')

ROOT = Path(__file__).parents[2]
EMPS = ROOT.parent / 'shared' / 'data' / 'emps'
AXIS_TRUTH = np.array([95.11, 203.5, 20.39, -3.165])
START_NS = 1_700_000_000_000_000_000

CART = Robot(
    name='cart',
    joints=(Joint('cart', kind='prismatic'),),
    target='effort',
    terms=(single_column(Coefficient('mass', 'kg', 'cart'), 0, acceleration(0), 'Newton'),),
    residual_inputs=(('velocity:cart',),),
)
"""Nothing but a mass: its motion under held forces is known in closed form."""


def simulated_events(robot, duration, **choices):
    """Return the events of a simulation."""
    recording = simulate(make_simulation(robot, start_ns=START_NS, **choices), duration)
    velocity = recording.velocity
    for i, stamp in enumerate(recording.stamps_ns):
        yield CommandSample(int(recording.command_stamps_ns[i]), recording.command[i])
        yield JointSample(
            int(stamp),
            recording.joint_names,
            recording.position[i],
            None if velocity is None else velocity[i],
        )


def axis_signals(duration=30.0, **choices):
    """Return the signals of a simulated linear axis, without unmodelled force by default."""
    settings = {'rate_hz': 200.0, **choices}
    events = simulated_events('linear_axis', duration, **settings)
    return collect_signals(events, LINEAR_AXIS, EngineConfig(max_gap=0.1))


def emps_signals(name='emps_id'):
    """Return the signals of a record of the EMPS axis."""
    mapping = read_map(ROOT / 'config' / 'import' / 'emps.yaml')
    events = read_table(EMPS / f'{name}.csv', mapping).events()
    return collect_signals(events, LINEAR_AXIS, EngineConfig(max_gap=0.1))


def cart_events(times, switches, forces, mass=2.0):
    """Return states of a mass at `times` [s] under forces held from `switches` on, in shuffle."""
    knots = np.array([*switches, times[-1] + 1.0])
    position, velocity, events = 0.0, 0.0, []
    for start, end, force in zip(knots, knots[1:], forces, strict=False):
        a = force / mass
        events.append(CommandSample(START_NS + round(start * 1e9), frozen_array([force])))
        for t in times[(times >= start) & (times < end)]:
            q = position + velocity * (t - start) + 0.5 * a * (t - start) ** 2
            stamp = START_NS + round(t * 1e9)
            events.append(JointSample(stamp, ('cart',), frozen_array([q])))
        h = end - start
        position, velocity = position + velocity * h + 0.5 * a * h * h, velocity + a * h
    order = np.random.default_rng(1).permutation(len(events))
    return [events[i] for i in order]


def moved_axis(seed, *, duration=30.0, rate=200.0, encoder=0.0, force=1.0, colour=0.0, extra=None):
    """Return signals of an axis that follows five sinusoids exactly, in closed form.

    Args:
        seed: of motion and noise.
        duration: [s].
        rate: [Hz].
        encoder: standard deviation of the position [m].
        force: standard deviation of the force [N].
        colour: correlation of the force noise from sample to sample.
        extra: force beside the physics, from velocity (n,) [m/s] to (n,) [N].
    """
    rng = np.random.default_rng(seed)
    n = round(duration * rate)
    t = np.arange(n) / rate
    omega = 2.0 * np.pi * rng.uniform(0.1, 0.8, 5)
    phase = rng.uniform(0.0, 2.0 * np.pi, 5)
    angle = np.outer(t, omega) + phase
    q = 0.05 * np.sin(angle).sum(axis=1)
    v = 0.05 * (np.cos(angle) @ omega)
    a = -0.05 * (np.sin(angle) @ omega**2)
    noise = rng.normal(size=n) * force * np.sqrt(1.0 - colour**2)
    noise = signal.lfilter([1.0], [1.0, -colour], noise)
    effort = np.column_stack([a, v, np.sign(v), np.ones(n)]) @ AXIS_TRUTH + noise
    if extra is not None:
        effort = effort + extra(v)
    q = q + encoder * rng.normal(size=n)
    return Signals(
        t, q[:, None], None, effort[:, None], None, (slice(0, n),), {}, {}, rate, START_NS
    )
