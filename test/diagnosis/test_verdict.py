"""The verdict where nothing is missing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import findings
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, SLIGHT_REST
from sgp_ros.diagnosis.findings import verdict_of
from sgp_ros.physics.catalogue import COMMAND_DELAY, VISCOUS_FRICTION
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo

LITTLE, MUCH, SLIGHT = 0.5 * COUNTED_SHARE, 2.0 * COUNTED_SHARE, 0.5 * SLIGHT_REST


@pytest.mark.parametrize(
    ('said', 'wrong', 'nominal', 'gained', 'setup', 'beside', 'verdict'),
    [
        ('parameters_only', (), LITTLE, LITTLE, (), (), 'no_mismatch'),
        ('parameters_only', (), MUCH, MUCH, (), (), 'parameters_only'),
        ('parameters_only', ('mass',), LITTLE, LITTLE, (), (), 'parameters_only'),
        ('parameters_only', ('mass',), LITTLE, SLIGHT, (), (), 'no_mismatch'),
        ('parameters_only', (), MUCH, SLIGHT, (), (), 'parameters_only'),
        ('no_mismatch', (), LITTLE, LITTLE, (), (), 'no_mismatch'),
        ('no_mismatch', (), LITTLE, LITTLE, (), ('lag',), 'missing_physics'),
        ('parameters_only', ('mass',), MUCH, MUCH, ('sign',), (), 'setup_error'),
        ('parameters_only', ('mass',), MUCH, MUCH, ('sign',), ('lag',), 'missing_physics'),
        ('unexplained', (), LITTLE, LITTLE, ('sign',), ('lag',), 'unexplained'),
    ],
)
def test_bodies_are_wrong_where_one_is_or_where_all_together_count(
    said, wrong, nominal, gained, setup, beside, verdict
):
    decision = SimpleNamespace(verdict=said)
    shares = (np.array([0.0, nominal]), np.array([0.0, gained]))
    assert verdict_of(decision, wrong, setup, *shares, beside) == verdict


def test_a_weight_that_is_held_hides_no_wrong_mass():
    """A hundredth of a weight is nothing of the mean square, and much of what varies."""
    effort = 100.0 + np.sin(np.linspace(0.0, 60.0, 3000))[:, np.newaxis]
    power = (effort**2).mean(axis=0)
    nominal, bodies = (SimpleNamespace(left=x**2 / power) for x in (np.ones(1), np.zeros(1)))
    several = SimpleNamespace(comparison=SimpleNamespace(nominal=nominal, parameters=bodies))
    equations = SimpleNamespace(power=power, motion=SimpleNamespace(effort=effort))
    left, gained = Connected.left.fget(SimpleNamespace(several=several, equations=equations))
    assert gained < SLIGHT_REST < COUNTED_SHARE < left
    calm = SimpleNamespace(verdict='parameters_only')
    assert verdict_of(calm, (), (), left, gained, ()) == 'parameters_only'
    assert verdict_of(calm, (), (), nominal.left, gained, ()) == 'no_mismatch'


class AskedError(Exception):
    """With the joints that intervals are told of."""


def test_intervals_of_findings_are_told_which_joints_are_unknown(monkeypatch):
    """A rest there widens no interval of another joint."""

    def widened(_equations, _model, unknown=()):
        raise AskedError(unknown)

    monkeypatch.setattr(findings, 'widened', widened)
    model = SimpleNamespace(effects=(SimpleNamespace(effect=None),), forces=(None,))
    decision = SimpleNamespace(model=model, unknown=(1,))
    with pytest.raises(AskedError) as asked:
        findings.asserted(None, decision, (), (), None, ())
    assert asked.value.args == ((1,),)


@pytest.mark.parametrize('is_target', [False, True])
def test_a_delay_of_commands_or_targets_comes_with_how_long_they_hold(is_target):
    """A log may have samples of what a faster controller sends, which it cannot tell."""
    commands = Drive(0.01 * np.arange(50.0), np.zeros((50, 2)), ((0.0, 50),), 0.01)
    none = np.zeros((50, 1))
    servo = Servo(commands, 0.01, (0,), 1.5 * np.ones(1), np.ones(1), none, none, none)
    tree = SimpleNamespace(joint_names=('knee',))
    motion = SimpleNamespace(drive=servo if is_target else commands, tree=tree)
    late = SimpleNamespace(
        effect=COMMAND_DELAY, at_bounds=lambda _: (), report=lambda _: {'delay': 0.02}
    )
    frame = SimpleNamespace(equations=SimpleNamespace(motion=motion))
    model = SimpleNamespace(frame=frame, effects=(late,))
    (said,) = findings.bound_remarks(SimpleNamespace(model=model))
    assert '10 ms later' in said
    assert 'the delay is 5 ms longer' in said
    model.effects = (EffectAt(VISCOUS_FRICTION, Place(0), coefficients=np.array([0.1])),)
    said = findings.bound_remarks(SimpleNamespace(model=model))
    assert [x for x in said if 'larger, by 0.0075 on knee.' in x] == [*said[:is_target]]
    model.effects = ()
    assert not findings.bound_remarks(SimpleNamespace(model=model))
