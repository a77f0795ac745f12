"""Answers of worlds in which a machine and its simulation differ."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from sgp_proof.connection import simulated


def _effect(level):
    at = SimpleNamespace(name='coulomb_friction', joint='elbow', parameters={'level': level})
    return SimpleNamespace(at=at)


@pytest.mark.parametrize(
    ('machine', 'simulation', 'size'), [(0.6, 0.4, 0.2), (0.6, None, 0.6), (None, 0.4, -0.4)]
)
def test_a_difference_is_that_of_the_machine_less_that_of_the_simulation(
    machine, simulation, size
):
    """And it is right to name it within a tenth."""
    sides = (None if x is None else _effect(x) for x in (machine, simulation))
    wanted = simulated._drawn(*sides)
    assert (wanted['effect'], wanted['joint']) == ('coulomb_friction', 'elbow')
    assert wanted['level'] == pytest.approx(size)
    said = {'effect': 'coulomb_friction', 'joint': 'elbow',
            'difference': {'level': {'value': 1.05 * size, 'std': 0.0}}}  # fmt: skip
    assert simulated._is(wanted, said)
    said['difference']['level']['value'] = 1.2 * size
    assert not simulated._is(wanted, said)
