"""Every effect is found over its whole physical range, on equations that hold nothing else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.volume import Loop
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion

RATE, SECONDS, CUTOFF = 200.0, 16.0, 25.0
NOISE = 1e-3
"""Of what is left, relative to the force of the effect."""
ARM = """<robot name="arm"><link name="world"/>
<joint name="shoulder" type="revolute"><parent link="world"/><child link="upper"/>
<axis xyz="0 1 0"/>
<limit lower="-2.9" upper="2.9" effort="50" velocity="9"/></joint>
<link name="upper"><inertial><origin xyz="0.02 0 -0.2"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.02" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
<limit lower="-2.9" upper="2.9" effort="50" velocity="9"/></joint>
<link name="fore"><inertial><origin xyz="0 0.01 -0.15"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="tip" type="fixed"><parent link="fore"/><child link="tool0"/><origin xyz="0 0 -0.3"/>
</joint><link name="tool0"/><ros2_control name="c" type="system">
<joint name="shoulder"><command_interface name="effort"/></joint>
<joint name="elbow"><command_interface name="effort"/></joint></ros2_control></robot>"""


@cache
def motion():
    """Sums of sines over most of the range, commands that hold for 10 ms."""
    tree = read_urdf(ARM)
    rng = np.random.default_rng(1)
    t = np.arange(round(RATE * SECONDS)) / RATE
    omega = np.array([[0.7, 1.9, 4.3], [1.1, 2.3, 5.2]])
    size = np.array([[1.1, 0.5, 0.15], [0.9, 0.6, 0.12]])
    angle = omega * t[:, None, None] + rng.uniform(0.0, 6.0, (2, 3))
    q = (size * np.sin(angle)).sum(axis=2)
    v = (size * omega * np.cos(angle)).sum(axis=2)
    a = -(size * omega**2 * np.sin(angle)).sum(axis=2)
    seen = ObservedMotion(tree, t, 1.0 / RATE, q, v, a, np.zeros_like(q), None)
    given = t[::2]
    drive = Drive(given, seen.nominal_effort[::2], ((0.0, len(t)),), 1.0 / RATE)
    effort = np.column_stack([drive.effort(j) for j in range(2)])
    return ObservedMotion(tree, t, 1.0 / RATE, q, v, a, effort, drive)


def equations_of(truth):
    """Equations of which an effect is the whole discrepancy, but for a little noise."""
    seen = motion()
    if truth.effect.is_on_tree:  # what is carried is carried by the motors
        seen = replace(seen, effort=seen.effort - truth.force(seen))
    low = ParallelFilter(RATE, CUTOFF, (slice(0, len(seen.time)),))
    rows = low.rows
    d = low(truth.force(seen))
    noise = NOISE * np.sqrt((d**2).mean())
    d = d + noise * np.random.default_rng(2).normal(size=d.shape)
    power = (seen.effort**2).mean(axis=0)
    still = np.zeros(seen.position.shape, dtype=bool)
    empty = (np.zeros((len(d), 0)),) * d.shape[1]
    return Equations(
        seen, low, seen.time[rows], d, empty, np.zeros((0, 20)), power, np.full(2, 1e-9),
        np.ones(seen.position.shape), still, *[np.zeros(2)] * 4, Loop.of(seen, CUTOFF),
    )  # fmt: skip


def _levels(name, key, values, **others):
    return [(name, {key: x, **others}) for x in values]


SPAN, FAST = 3.0, 3.5
"""Range [rad] and greatest speed [rad/s] of the elbow, about."""
CASES = [
    *_levels('cogging', 'periods', (3.2, 11.0, 72.0, 160.0), amplitude=0.2, phase=0.7),
    *_levels('encoder_eccentricity', 'periods', (1.0, 2.0, 9.0, 41.0), amplitude=2e-3, phase=0.5),
    *_levels('encoder_eccentricity', 'amplitude', (1e-4, 0.1), periods=3.0, phase=0.5),
    *_levels('stribeck_friction', 'stribeck_velocity', (0.05, 0.4, 3.0), coulomb=0.1, static=0.4),
    *_levels('friction_drift', 'time_constant', (0.2, 2.0, 12.0, 30.0), start=0.6, end=0.1,
             kind='coulomb'),
    *_levels('hysteresis', 'presliding', (0.001, 0.01, 0.1, 1.0, 3.0), level=0.4),
    *_levels('command_delay', 'delay', (0.0005, 0.004, 0.05, 0.3, 0.7)),
    *_levels('actuator_lag', 'time_constant', (0.0005, 0.004, 0.05, 0.3, 0.7)),
    *_levels('dead_zone', 'width', (0.01, 0.3, 1.5)),
    *_levels('saturation', 'limit', (0.05, 0.5, 1.5)),
    *_levels('motor_speed_limit', 'no_load_speed', (2.5, 4.0, 20.0), stall_torque=1.0),
    *_levels('joint_elasticity', 'stiffness', (10.0, 100.0, 3000.0), damping=0.02,
             motor_inertia=0.004, encoder='motor'),
    *_levels('joint_elasticity', 'stiffness', (10.0, 100.0), damping=0.02, motor_inertia=0.004,
             encoder='link'),
    *_levels('torque_gain', 'gain', (0.07, 0.5, 0.97, 4.0, 30.0)),
    *_levels('backlash', 'gap', (0.002, 0.03, 0.4), motor_share=0.3),
    *_levels('payload', 'mass', (0.05, 0.6, 2.8, 12.0), x=0.02, y=0.0, z=-0.25),
    *_levels('payload', 'z', (0.1, -0.5), x=0.05, y=0.03, mass=1.0),
    *_levels('gravity_tilt', 'roll', (0.02, 0.15, -0.3), pitch=0.1),
    *_levels('joint_coupling', 'ratio', (-6.0, 0.2, 3.0), stiffness=0.8, kind='spring'),
    *_levels('coupled_friction', 'ratio', (-6.0, -1.0, 0.2, 3.0, 25.0), coulomb=0.3, viscous=0.1),
    *_levels('end_stop', 'position', (-0.9, 0.0, 1.2), stiffness=20.0, damping=0.2, side='upper'),
    *_levels('limit_friction', 'onset', (-1.0, 0.3, 1.2), amplitude=1.0, side='upper'),
    *_levels('position_friction', 'lo', (-1.1, 0.0, 0.3), hi=0.4, amplitude=0.3, kind='coulomb'),
    *_levels('spring', 'rest', (-40.0, 0.0, 9.0), stiffness=0.5),
    *_levels('quadratic_drag', 'c', (1e-3, 20.0)),
    *_levels('armature', 'inertia', (1e-4, 3.0)),
]  # fmt: skip


def _truth(name, numbers):
    seen, effect = motion(), EFFECTS[name]
    words = {'source_joint': 'shoulder'} if effect.has_source else {}
    joint = {'gravity_tilt': 'base', 'payload': 'elbow'}.get(name, 'elbow')
    share = numbers.get('motor_share')
    given = {k: x for k, x in numbers.items() if k != 'motor_share'}
    truth = EffectAt.stated(effect, joint, given | words, seen.tree)
    if share is not None:
        truth = truth.with_shape(np.array([share, numbers['gap'], 0.0, 0.0]))
    return truth


@pytest.mark.parametrize(('name', 'numbers'), CASES, ids=lambda x: str(x)[:60])
def test_an_effect_of_any_size_is_found_and_explains_its_force(name, numbers):
    """A search that ends short of it would leave most of the force."""
    truth = _truth(name, numbers)
    equations = equations_of(truth)
    columns = Columns(equations)
    start = fit(columns, (), np.sqrt((equations.d**2).mean(axis=0)) + 1e-9, is_free=False)
    found = [s for _, s in screen(columns, start, [truth.effect]) if s.place == truth.place]
    assert found
    models = [fit(columns, (s,), start.sigma, is_free=False) for s in found]
    best = max(models, key=lambda m: m.score)
    assert best.mean_square.sum() < 0.01 * (equations.d**2).mean(axis=0).sum()
