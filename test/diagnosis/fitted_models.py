"""Models fitted to the equations of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Place


def fitted(equations, *names, is_free=False):
    """Return a model of effects on joint 0, from the first of their shapes."""
    candidates = tuple(
        EffectAt(EFFECTS[n], Place(0), EFFECTS[n].starts(equations.motion, Place(0))[0])
        for n in names
    )
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    return fit(Columns(equations), candidates, start, is_free=is_free)


def with_coefficients(model, coefficients):
    """Return a model of one effect with other coefficients."""
    (effect,) = model.effects
    return replace(model, effects=(replace(effect, coefficients=coefficients),))
