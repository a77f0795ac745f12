"""Which fitted laws cannot be what their names state."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sgp_ros.diagnosis.explain.credibility import _delivers, is_credible
from test.diagnosis.fitted_models import fitted


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
