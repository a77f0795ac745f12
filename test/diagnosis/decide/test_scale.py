"""Fits of models to measured efforts, in whatever unit these and the bodies are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.fitted_model import floors

POWER = np.array([4.0, 9.0])


def _scale(noise):
    return Scale(
        POWER, noise + 1e-5 * POWER, noise, 1e-3 * np.ones(2), 0.1 * np.ones(2), 100.0
    )  # fmt: skip


def _model(inertia, mean_square, moving=1.0):
    """Return a model whose second joint is held by dry friction in part of the rows."""
    rows = np.column_stack([np.ones(10), np.arange(10) < 10 * moving])
    frame = SimpleNamespace(equations=SimpleNamespace(moving=rows))
    return SimpleNamespace(inertia=inertia, mean_square=mean_square, frame=frame, effects=())


@pytest.mark.parametrize('noise', [0.0, 0.01])
def test_heavier_bodies_or_efforts_in_another_unit_fit_alike(noise):
    """Both are the same motion: noise is as much smaller as the efforts, in any bodies' sight."""
    scale, inertia = _scale(noise * POWER), np.array([0.3, 0.8])
    heavier = _model(inertia, 0.012 * POWER)
    lighter = _model(inertia - np.log(1.7), 0.012 * POWER / 1.7**2)
    other = replace(scale, noise=scale.noise / 1.7**2, error=scale.error - noise * POWER)
    other = replace(other, error=other.error + other.noise)
    assert other.likelihood(lighter) == pytest.approx(scale.likelihood(heavier), abs=1e-9)


def test_friction_that_holds_a_joint_takes_nothing_of_its_inertia():
    """Behind a large rotor, a model without that friction would else be worth more."""
    scale, inertia = (
        replace(_scale(0.0 * POWER), carried=np.array([0.0, 5.0])),
        np.array([0.0, 5.0]),
    )
    free, held = (_model(inertia, 0.012 * POWER, moving) for moving in (1.0, 0.4))
    assert scale.likelihood(held) == pytest.approx(scale.likelihood(free))


def test_the_least_variance_grows_with_inertia_but_for_noise(equations_for, perfect):
    """Errors of the motion are accelerations, that of a torque sensor is a torque."""
    world = perfect[1]
    _, equations = equations_for(world, effort=world.command, commands=False)
    motion = floors(replace(equations, model_error=0.0 * POWER[:1], effort_noise=0.0 * POWER[:1]))
    noisy = replace(equations, model_error=POWER[:1], effort_noise=POWER[:1])
    np.testing.assert_allclose(floors(noisy), motion + 4.0)
    np.testing.assert_allclose(floors(noisy, np.log(2.0)), 4.0 * motion + 4.0)
