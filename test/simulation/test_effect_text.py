"""Laws of effects written as text."""

from __future__ import annotations

import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import COULOMB_FRICTION, EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Quantity
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.effect_text import parse_effect, parse_physical
from sgp_ros.simulation.registry import LAWS


def test_text_is_read_as_written():
    """Order of parameters and spaces do not matter; words stay words."""
    effect = parse_effect(
        'position_friction: hi=2.5, joint=pole, kind=viscous, lo=2,amplitude=1e-2'
    )
    assert (effect.name, effect.joint) == ('position_friction', 'pole')
    assert effect.parameters == {'hi': 2.5, 'kind': 'viscous', 'lo': 2.0, 'amplitude': 0.01}


def test_parameters_are_the_quantities_of_the_catalogue():
    """Names, units, limits and kinds stand there once; the simulation adds words and defaults."""
    for name, law in LAWS.items():
        known = {p.name: p for p in law.parameters(EFFECTS[name])}
        assert all(isinstance(p, Quantity) for p in known.values())
        for q in EFFECTS[name].quantities:
            same = known[q.name]
            assert (same.unit, same.low, same.kinds) == (q.unit, q.low, q.kinds), name


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', ['unknown name', 'viscous_friction']),
        ('stiction:joint=pole,level=1', ["'stiction'", 'coulomb_friction', 'command_delay']),
        ('coulomb_friction', ['joint is missing', 'level is missing', 'level >= 0 [N m]']),
        ('coulomb_friction:joint=pole', ['level is missing']),
        ('coulomb_friction:level=1', ['joint is missing']),
        ('coulomb_friction:joint=pole,level=high', ['level = high']),
        ('coulomb_friction:joint=pole,level=nan', ['level = nan']),
        ('coulomb_friction:joint=pole,level=-1', ['level = -1', '>= 0']),
        ('coulomb_friction:joint=pole,level=1,b=2', ['no parameter b']),
        ('coulomb_friction:joint=pole,level=1,level=2', ['level is given twice']),
        ('coulomb_friction:joint=pole,level', ["'level' is not of the form name=value"]),
        (
            'position_friction:joint=pole,amplitude=1,lo=2,hi=1,kind=coulomb',
            ['lo is not below hi'],
        ),
        ('position_friction:joint=pole,amplitude=1,lo=1,hi=2,kind=sticky', ['coulomb or viscous']),
    ],
)
def test_wrong_texts_are_refused_in_one_line(text, words):
    """All problems at once, with what exists."""
    with pytest.raises(ConfigError) as refusal:
        parse_effect(text)
    assert '\n' not in str(refusal.value)
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


def test_joint_must_exist_and_have_a_motor_where_needed():
    """Whether a joint exists depends on the robot, so the simulation refuses."""
    with pytest.raises(ConfigError, match=r"'elbow'.*\['pole', 'wheel'\]"):
        make_simulation('reaction_wheel', effects=['coulomb_friction:joint=elbow,level=1'])
    with pytest.raises(ConfigError, match=r"'pole'.*\['wheel', 'all'\]"):
        make_simulation('reaction_wheel', effects=['command_delay:joint=pole,delay=0.01'])
    with pytest.raises(ConfigError, match='a robot with a motor'):
        make_simulation('toy_pendulum', effects=['command_delay:joint=hinge,delay=0.01'])


def test_effects_that_were_not_read_from_text_are_checked_too():
    """A value built by a program has the same law as a text."""
    with pytest.raises(ConfigError, match='level is missing'):
        make_simulation('reaction_wheel', effects=[EffectAt.wanted(COULOMB_FRICTION, 'pole', {})])


def test_a_parameter_of_one_kind_belongs_to_no_other():
    """Whichever word says the kind; only a motor's encoder leaves friction on the motor unseen."""
    spring = 'joint_elasticity:joint=pole,stiffness=9,damping=0,motor_inertia=0.1'
    parse_effect(f'{spring},encoder=motor')
    parse_effect(f'{spring},encoder=motor,motor_friction=1')
    parse_effect(f'{spring},encoder=link')
    with pytest.raises(ConfigError, match='no parameter motor_friction'):
        parse_effect(f'{spring},encoder=link,motor_friction=1')


def test_physical_parameters_are_read_as_numbers():
    """`NAME=value`, refused with an example otherwise."""
    assert parse_physical(['pole_viscosity=0', 'gravity = 1.62']) == {
        'pole_viscosity': 0.0, 'gravity': 1.62
    }  # fmt: skip
    for text in ('pole_viscosity', 'pole_viscosity=none', '=3'):
        with pytest.raises(ConfigError, match='NAME=number'):
            parse_physical([text])
