"""Models fitted to the equations of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place


def fitted(equations, *names, is_free=False):
    """Return a model of effects on joint 0, or on a link, from the first of their shapes."""
    motion = equations.motion
    laws = [EFFECTS[n] for n in names]
    places = [law.places(motion)[0] if law.is_body else Place(0) for law in laws]
    candidates = tuple(
        EffectAt(law, place, law.starts(motion, place)[0])
        for law, place in zip(laws, places, strict=True)
    )
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    return fit(Columns(equations), candidates, start, is_free=is_free)


def with_coefficients(model, coefficients):
    """Return a model of one effect with other coefficients."""
    (effect,) = model.effects
    return replace(model, effects=(replace(effect, coefficients=coefficients),))
