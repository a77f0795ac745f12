"""Wrong bodies are told by their masses and centres, one body by itself where that will do."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis import wrong_bodies
from sgp_ros.diagnosis.wrong_bodies import (
    _changed,
    _numbers,
    parameter_errors,
    traded_remarks,
)
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.mark.parametrize(('link', 'mass', 'centre'), [(1, 1.2, 1.0), (1, 1.0, 1.2)])
def test_one_wrong_body_is_told_with_its_numbers(equations_for, link, mass, centre):
    """Masses of a chain trade with each other's centres: alone they are known."""
    chain = list(CHAINS[2])
    stated = chain[link]
    chain[link] = replace(stated, mass=mass * stated.mass, centre=centre * stated.centre)
    _, equations = equations_for(simulate(tuple(chain), 5))
    name = equations.motion.tree.link_names[link]
    found = parameter_errors(equations, fitted(equations, is_free=True))
    assert {e.link for e in found} == {name}
    by_name = {e.parameter: e for e in found}
    wanted = {'mass': chain[link].mass, 'com_z': -chain[link].centre}
    for parameter, error in by_name.items():
        assert abs(error.value - wanted[parameter]) < 4.0 * error.std
        assert error.value == pytest.approx(wanted[parameter], rel=0.02)
    assert ('mass' if mass > 1.0 else 'com_z') in by_name


@pytest.mark.parametrize('wrong', [1, 2])
def test_what_differs_from_another_machine_is_told_as_one_body_or_as_traded(equations_for, wrong):
    """Both differ from the file alike; of two bodies that differ no number is known by itself."""
    first, second = CHAINS[2]
    first = replace(first, mass=1.2 * first.mass)
    loaded = replace(second, mass=1.3 * second.mass)
    moved = first
    if wrong == 2:
        moved = replace(first, mass=1.5 * first.mass)
        loaded = replace(second, centre=1.3 * second.centre)
    (_, ours), (_, theirs) = (
        equations_for(simulate(chain, seed))
        for seed, chain in ((5, (moved, loaded)), (6, (first, second)))
    )
    here, there = (fitted(x, is_free=True) for x in (ours, theirs))
    found = parameter_errors(ours, here, other=there)
    said = list(traded_remarks(ours, here, found, other=there))
    if wrong == 2:
        assert said
        return
    assert not said
    mass = {e.parameter: e for e in found}['mass']
    assert mass.link == ours.motion.tree.link_names[1]
    assert mass.value - mass.nominal == pytest.approx(0.3 * second.mass, rel=0.05)
    assert {e.link for e in found} == {mass.link}


def test_two_wrong_bodies_are_not_told_as_one(equations_for):
    """Of a chain whose first link is longer in its centre, and whose second is lighter."""
    first, second = CHAINS[2]
    chain = (replace(first, inertia=2.0 * first.inertia), replace(second, mass=0.7 * second.mass))
    _, equations = equations_for(simulate(chain, 5))
    model = fitted(equations, is_free=True)
    alone = [e for e in parameter_errors(equations, model) if e.std < 1e-3 * abs(e.value)]
    assert not alone


@pytest.mark.parametrize('beside', [1.0, 1.2])
def test_numbers_that_trade_are_told_as_such(monkeypatch, equations_for, beside):
    """A heavier second body, or one with its centre further out, and a first one like it.

    With the number of the model itself, whatever it is beside offsets of the efforts.
    """
    first, second = CHAINS[2]
    chain = replace(first, mass=1.5 * first.mass), replace(second, centre=1.3 * second.centre)
    _, equations = equations_for(simulate(chain, 5))
    names = equations.motion.tree.link_names
    model = fitted(equations, is_free=True)
    errors = parameter_errors(equations, model)
    monkeypatch.setattr(wrong_bodies, '_with_offsets', lambda _, m: replace(m, w=beside * m.w))
    (said,) = traded_remarks(equations, model, errors)
    centre = re.search(
        f'z of the centre of mass of {names[1]} -([0-9.]+) instead of -0.15 m', said
    )
    assert float(centre.group(1)) == pytest.approx(chain[1].centre, rel=0.02)
    assert f'mass of {names[1]}' in said


def test_bodies_that_one_explains_trade_with_none(equations_for):
    """One body with a shifted centre is told by itself, without a remark."""
    first, second = CHAINS[2]
    chain = first, replace(second, centre=1.2 * second.centre)
    _, equations = equations_for(simulate(chain, 5))
    model = fitted(equations, is_free=True)
    assert not [*traded_remarks(equations, model, parameter_errors(equations, model))]


def test_offsets_of_efforts_are_an_error_of_bodies(equations_for):
    """A sensor that is off by a part of the weight moves a centre that is right."""
    world = simulate(CHAINS[1], 5)
    offset = 0.1 * np.sqrt((world.command**2).mean())
    _, equations = equations_for(replace(world, command=world.command + offset))
    model = fitted(equations, is_free=True)
    stated = equations.motion.tree.parameters
    by_chance = _numbers(equations, *_changed(model), stated, ())[0]
    (alone,) = (e for e in by_chance if e.parameter == 'com_x')
    assert abs(alone.value - alone.nominal) > 5.0 * alone.std
    assert 'com_x' not in {e.parameter for e in parameter_errors(equations, model)}
