"""What is said of models that were not asserted."""

from __future__ import annotations

import pytest

from sgp_ros.diagnosis.decide.certainty import Probabilities
from sgp_ros.diagnosis.findings import doubted_if_none
from sgp_ros.diagnosis.result import Finding, Location, Parameter
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Place
from test.diagnosis.fitted_models import fitted


def test_a_rival_beside_what_is_asserted_is_told_from_one_in_its_place(equations_for, viscous):
    """It leaves less than the asserted model and still lost: what it adds is next to nothing."""
    _, equations = equations_for(viscous)
    asserted = fitted(equations, 'viscous_friction')
    said = Probabilities({}, 0.1, asserted, equations.power)
    more = fitted(equations, 'viscous_friction', 'quadratic_drag')
    assert 'beside the asserted model' in said.why(more)
    assert 'beside' not in said.why(fitted(equations, 'spring'))


@pytest.mark.parametrize(('std', 'is_doubted'), [(0.002, False), (0.006, True), (None, False)])
def test_an_encoder_that_may_be_centred_is_doubted(std, is_doubted):
    """An amplitude of 0.01 rad, with 95 % intervals that leave zero out or hold it."""
    law = EFFECTS['encoder_eccentricity']
    numbers = {'amplitude': 0.01, 'periods': 1.0, 'phase': 0.3}
    found = {
        name: Parameter(x, std if name == 'amplitude' else 0.1) for name, x in numbers.items()
    }
    finding = Finding('elbow', law.name, found, Location(), 30.0, 0.9, 0.1, law.formula)
    told = doubted_if_none(finding, EffectAt(law, Place(0)))
    assert (told.probability, bool(told.why)) == ((0.4, True) if is_doubted else (0.9, False))


def test_a_gain_is_none_at_one():
    """Its size is measured from there."""
    law = EFFECTS['torque_gain']
    for gain, expected in ((1.05, 0.4), (1.5, 0.9)):
        found = {'gain': Parameter(gain, 0.05)}
        finding = Finding('elbow', law.name, found, Location(), 30.0, 0.9, 0.1, law.formula)
        assert doubted_if_none(finding, EffectAt(law, Place(0))).probability == expected
