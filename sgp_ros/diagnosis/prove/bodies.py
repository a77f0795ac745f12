"""The inertial parameters that a diagnosis ends with, brought to bodies that can exist."""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.errors import NumericalError
from sgp_ros.rigid.consistent import project_information
from sgp_ros.rigid.pseudo_inertia import is_consistent


def diagnosed_bodies(equations: Equations, model: Model) -> np.ndarray | None:
    """Return the inertial parameters of the bodies, (b, 10), in the order of the tree.

    The model's change w of the parameters has the information `R^T R`, its prior included. Where
    it leads to bodies that cannot exist, those that the data contradict least take their place.

    Args:
        equations: of the recording.
        model: that was asserted.

    Returns:
        None where the bodies are the nominal ones, or none that can exist were found.
    """
    if not model.is_free:
        return None
    nominal = equations.motion.tree.parameters
    D = equations.directions  # (p, 10 b), parameters change by w @ D
    changed = (nominal.ravel() + model.w @ D).reshape(nominal.shape)
    if np.all(is_consistent(changed)):
        return changed
    root = np.linalg.solve(D, model.frame.R.T).T  # R w = root @ change
    blocks = [range(10 * i, 10 * i + 10) for i in range(len(nominal))]
    try:
        found = project_information(changed.ravel(), root, blocks, reference=nominal.ravel())
    except NumericalError:
        return None
    return found.coefficients.reshape(nominal.shape)
