"""Models fitted to the equations of a recording."""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.suspects import Columns, Suspect
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Place


def fitted(equations, *names, is_free=False):
    """Return a model of effects on joint 0, from the first of their shapes."""
    suspects = tuple(
        Suspect(EFFECTS[n], Place(0), EFFECTS[n].starts(equations.motion, Place(0))[0])
        for n in names
    )
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    return fit(Columns(equations), suspects, start, is_free=is_free)
