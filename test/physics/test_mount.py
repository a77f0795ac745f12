"""A base on a flexible mount, on motions that were simulated with the base as a body."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.physics.test_elasticity import equations_of, moved

LAW = EFFECTS['mount_elasticity']
NUMBERS = {'frequency': 8.0, 'damping_ratio': 0.05, 'moved_mass': 6.0}


@cache
def equations(axis):
    """The equations of an arm whose base gives way along an axis."""
    text = ','.join(f'{name}={x}' for name, x in NUMBERS.items())
    return equations_of(moved([f'mount_elasticity:joint=base,axis={axis},{text}']))


def begun_late(recording, rows):
    """The same motion without its first rows, while the base still swings."""
    names = ('stamps_ns', 'shown_position', 'command')
    return replace(recording, **{name: getattr(recording, name)[rows:] for name in names})


@cache
def late_equations(axis):
    """The equations of the arm whose base swings where they begin."""
    text = ','.join(f'{name}={x}' for name, x in NUMBERS.items())
    recording = moved([f'mount_elasticity:joint=base,axis={axis},{text}'])
    return equations_of(begun_late(recording, 40))


@pytest.mark.parametrize('begin', [equations, late_equations])
@pytest.mark.parametrize('axis', 'xz')
def test_its_force_is_what_the_nominal_robot_lacks(axis, begin):
    """Below the bandwidth, with the resonance below it too; the wrong axis explains it not."""
    found = begin(axis)
    left = {}
    for kind in LAW.kinds:
        truth = EffectAt.stated(LAW, 'base', NUMBERS | {'axis': kind}, found.motion.tree)
        force = Columns(found).of(truth, found) @ truth.coefficients
        left[kind] = ((found.d - force) ** 2).sum() / (found.d**2).sum()
    assert left.pop(axis) < 1e-3
    assert min(left.values()) > 0.5


@pytest.mark.parametrize('axis', 'xz')
def test_frequency_damping_and_mass_follow_from_a_motion(axis):
    """The best of the starts is that of the axis, and its fit finds the numbers."""
    found = equations(axis)
    columns, start = Columns(found), np.sqrt((found.d**2).mean(axis=0)) + 1e-9
    nothing = fit(columns, (), start, is_free=False)
    (_, best), *_ = screen(columns, nothing, [LAW])
    assert best.place.kind == axis
    mount = fit(columns, (best,), start, is_free=False).effects[0]
    numbers = mount.report(found.motion)
    assert numbers['axis'] == axis
    for name, truth in NUMBERS.items():
        assert numbers[name] == pytest.approx(truth, rel=0.02), name


@pytest.mark.parametrize(
    ('numbers', 'is_one'),
    [({}, True), ({'frequency': 1.3}, True), ({'frequency': 0.6}, False),
     ({'damping_ratio': 0.6}, False), ({'moved_mass': 0.5}, False)],
    ids=['as it is', 'soft', 'it would sink', 'it does not ring', 'lighter than the arm'],
)  # fmt: skip
def test_what_a_search_takes_for_a_mount(numbers, is_one):
    """Of 0.6 Hz it is as well a load that hangs on a rope of 0.7 m; a file may state all."""
    found = equations('x').motion
    motion = replace(found, time=np.arange(4000) * found.step)
    at = EffectAt.stated(LAW, 'base', NUMBERS | numbers | {'axis': 'x'}, found.tree)
    assert LAW.is_inside(at, motion) is is_one
    assert LAW.is_possible(at, motion)


def test_a_joint_without_effort_does_no_harm():
    """A passive joint has a nominal effort alone; a roll-out that diverged has no numbers."""
    found = equations('x').motion
    passive = replace(found, effort=found.effort * [1.0, 0.0])
    still = replace(found, effort=np.zeros_like(found.effort))
    lost = replace(found, position=np.where(found.time[:, None] > 0.1, np.inf, found.position))
    with np.errstate(all='ignore'):
        assert not np.isfinite(LAW.columns(lost, Place(-1, 'x'), np.array([8.0, 0.05]))).all()
    undamped = LAW.columns(found, Place(-1, 'x'), np.array([8.0, 0.0]))
    assert np.isfinite(undamped).all()  # as a file may state it
    for motion in (passive, still):
        columns = LAW.columns(motion, Place(-1, 'x'), np.array([8.0, 0.05]))
        assert np.isfinite(columns).all()
        assert np.abs(columns).max() < 1e3
