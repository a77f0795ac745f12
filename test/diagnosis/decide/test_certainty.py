"""What is said of models that were not asserted."""

from __future__ import annotations

from sgp_ros.diagnosis.decide.certainty import Probabilities
from test.diagnosis.fitted_models import fitted


def test_a_rival_beside_what_is_asserted_is_told_from_one_in_its_place(equations_for, viscous):
    """It leaves less than the asserted model and still lost: what it adds is next to nothing."""
    _, equations = equations_for(viscous)
    asserted = fitted(equations, 'viscous_friction')
    said = Probabilities({}, 0.1, asserted, equations.power)
    more = fitted(equations, 'viscous_friction', 'quadratic_drag')
    assert 'beside the asserted model' in said.why(more)
    assert 'beside' not in said.why(fitted(equations, 'spring'))
