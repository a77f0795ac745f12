"""Which fitted laws cannot be what their names state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import ADEQUATE_REST, COUNTED_SHARE, SLIGHT_REST
from sgp_ros.diagnosis.explain.credibility import (
    _delivers,
    gain,
    is_credible,
    shows_waves,
    slight_rest,
)
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import are_apart
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.mark.parametrize(('times', 'credible'), [(2.0, True), (1000.0, False)])
def test_a_motor_delivers_what_it_was_commanded(equations_for, perfect, times, credible):
    """Half of the command is another torque constant, a thousandth another unit."""
    world = perfect[1]
    _, equations = equations_for(replace(world, command=times * world.command))
    model = fitted(equations, 'torque_gain')
    (gain,) = model.effects[0].report(equations.motion).values()
    assert gain == pytest.approx(1.0 / times, rel=0.02)
    assert _delivers(model) == credible
    assert is_credible(model) == credible


def test_a_motor_that_is_off_delivers_nothing_where_its_joint_rests_either(equations_for, perfect):
    """Rows in which friction may hold the joint count neither as commanded nor as delivered."""
    _, equations = equations_for(perfect[1])
    moving = np.ones_like(equations.moving)
    moving[: len(moving) // 3] = 0.0
    held = replace(equations, moving=moving)
    model = fitted(held, 'torque_gain')
    all_of_it = Columns(held).local(model.effects[0], held, held.motion)[..., 0]
    assert _delivers(replace(model, parts=(-0.5 * all_of_it,)))
    assert not _delivers(replace(model, parts=(-all_of_it,)))


def test_a_size_that_laws_seldom_have_takes_off_a_gain(equations_for, perfect):
    """A motor with a twentieth of its torque fits what it likes where bodies follow."""
    _, equations = equations_for(perfect[1])
    model = fitted(equations, 'torque_gain')
    (s,) = model.effects
    weak = replace(model, effects=(replace(s, coefficients=np.array([-0.95])),))
    assert weak.surprise > 50.0
    assert gain(weak, model) == pytest.approx(model.surprise - weak.surprise)


@pytest.mark.parametrize(
    ('nominal', 'slight'),
    [
        (0.5, SLIGHT_REST),
        (4.0 * COUNTED_SHARE, 4.0 * ADEQUATE_REST * COUNTED_SHARE),
        (0.5 * COUNTED_SHARE, SLIGHT_REST),
    ],
)
def test_what_is_slight_is_so_beside_what_there_is(equations_for, perfect, nominal, slight):
    """A twenty-fifth of a small friction is the rise of another one towards rest."""
    _, equations = equations_for(perfect[1])
    one = np.sqrt(nominal * equations.power) * np.ones_like(equations.d)
    assert slight_rest(replace(equations, d=one))[0] == pytest.approx(slight)


@pytest.mark.parametrize(('periods', 'shown'), [(1.0, True), (8.0, True), (300.0, False)])
def test_a_ripple_is_seen_over_whole_waves(equations_for, perfect, periods, shown):
    """One so short that it passes the filter only where the joint turns back is none."""
    _, equations = equations_for(perfect[1])
    ripple = EffectAt(EFFECTS['cogging'], Place(0), np.array([periods]))
    assert shows_waves(ripple, equations) == shown


@pytest.fixture(scope='module')
def long_swing(equations_for):
    """Equations of one link over a minute."""
    return equations_for(simulate(CHAINS[1], 1, 60.0))[1]


@pytest.mark.parametrize(('periods', 'shown'), [(80.0, True), (300.0, False)])
def test_a_short_ripple_is_seen_where_a_joint_turns_back_in_many_places(
    long_swing, periods, shown
):
    """Sixty waves in parts, all parts of it alike, are more than it could follow by chance."""
    ripple = EffectAt(EFFECTS['cogging'], Place(0), np.array([periods]))
    assert shows_waves(ripple, long_swing) == shown


@pytest.mark.parametrize(('drift', 'shown'), [(0.02, True), (0.0, False)])
def test_a_ripple_is_not_seen_where_a_joint_turns_back_in_the_same_places(
    long_swing, drift, shown
):
    """However often: it is one number for each place."""
    motion = long_swing.motion
    time = motion.time[:, None]
    position = 0.5 * np.sin(2.0 * np.pi * time) + drift * time
    swinging = replace(long_swing, motion=replace(motion, position=position))
    ripple = EffectAt(EFFECTS['cogging'], Place(0), np.array([4.0 * np.pi * 6.0]))
    assert shows_waves(ripple, swinging) == shown


@pytest.mark.parametrize(
    ('other', 'credible'), [('asymmetric_coulomb', False), ('constant_load', True)]
)
def test_two_laws_that_hold_the_same_plain_one_have_no_numbers(
    equations_for, perfect, other, credible
):
    """Friction that differs with direction beside one that falls is a constant load there."""
    _, equations = equations_for(perfect[1])
    both = [EffectAt(EFFECTS['stribeck_friction'], Place(0), np.array([0.1])),
            EffectAt(EFFECTS[other], Place(0))]  # fmt: skip
    assert are_apart(both, equations.motion) == credible
