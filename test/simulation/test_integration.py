"""Laws of the integration."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.simulation.integration import integrate
from sgp_ros.simulation.plant import Inputs, Plant
from sgp_ros.simulation.reaction_wheel import ReactionWheel


def end_state(count):
    plant = Plant(ReactionWheel(), 2, ())
    y = plant.initial((2.0, 0.0), (1.0, -5.0))
    inputs = Inputs(np.array([3.0]), np.zeros(2))
    for i in range(count):
        y = integrate(plant, i / count, y, 1.0 / count, inputs)
    return y


def test_error_falls_with_the_fourth_power_of_the_step():
    """Halving the step divides the error by about 16."""
    reference = end_state(1600)
    coarse, fine = (np.abs(end_state(n) - reference).max() for n in (50, 100))
    assert coarse / fine == pytest.approx(16.0, rel=0.2)


def test_substeps_of_a_millisecond_are_exact_enough():
    """The error of a second of motion is below a millionth of an encoder count."""
    assert np.abs(end_state(1000) - end_state(4000)).max() < 1e-9
