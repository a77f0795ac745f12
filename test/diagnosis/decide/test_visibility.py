"""Effects are found at twice the size that a recording says it would show, and not at half."""

from __future__ import annotations

import math

import pytest

from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.visibility import visibility
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.physics.catalogue import BACKLASH, COMMAND_DELAY, COULOMB_FRICTION, VISCOUS_FRICTION
from test.diagnosis.worlds import CHAINS, PERIOD, simulate

SEED, SECONDS = 1, 10.0
"""Of the fixture `perfect`."""


def _decided(equations):
    comparison = compare_models(equations, lambda _share: None)
    return comparison, decide(equations, comparison)


def _found(equations):
    return {s.effect.name: s for s in _decided(equations)[1].model.effects}


@pytest.fixture(scope='module')
def stated(perfect, equations_for):
    """Least sizes by effect, of one link without any."""
    _, equations = equations_for(perfect[1])
    return visibility(equations, *_decided(equations))


def _size(stated, effect):
    return next(p.value for (_, name, _), p in stated.items() if name == effect.name)


def _late(delay):
    def motor(commands, now):
        return commands[max(math.floor((now - delay) / PERIOD + 1e-6), 0)]

    return motor


def test_the_effects_of_the_schema_are_stated_with_their_units(stated):
    """Once for the joint, each with a size that this motion can show."""
    assert {(effect, name, p.unit) for (_, effect, name), p in stated.items()} == {
        (VISCOUS_FRICTION.name, 'b', 'N m s/rad'), (COULOMB_FRICTION.name, 'level', 'N m'),
        (COMMAND_DELAY.name, 'delay', 's'), (BACKLASH.name, 'gap', 'rad'),
    }  # fmt: skip
    assert all(0.0 < p.value < math.inf for p in stated.values())


@pytest.mark.long
@pytest.mark.parametrize('effect', [VISCOUS_FRICTION, COMMAND_DELAY])
def test_twice_the_stated_size_is_found_and_half_of_it_is_not(stated, equations_for, effect):
    """In the same motion, by the whole search."""
    least = _size(stated, effect)
    for factor, is_seen in ((0.5, False), (2.0, True)):
        size = factor * least
        world = simulate(CHAINS[1], SEED, SECONDS, **(
            {'motor': _late(size)} if effect is COMMAND_DELAY
            else {'force': lambda _t, _q, v, b=size: (-b * v[0],)}
        ))  # fmt: skip
        found = _found(equations_for(world)[1])
        assert (effect.name in found) == is_seen, (factor, found)
        assert found.keys() <= {effect.name}


@pytest.mark.long
def test_what_was_found_is_stated_too(viscous, equations_for, stated):
    """The friction that is there does not hide what would have been seen of it."""
    _, equations = equations_for(viscous)
    comparison, decision = _decided(equations)
    assert [s.effect for s in decision.model.effects] == [VISCOUS_FRICTION]
    least = _size(visibility(equations, comparison, decision), VISCOUS_FRICTION)
    assert 0.2 < least / _size(stated, VISCOUS_FRICTION) < 5.0
