"""Rebuilds a factor that rounding has lost, and measures how far a sound one has drifted.

Only the exact mode drops samples from a factor, the one step that loses digits. The features of a
basis stay as they are, and equations enter its triangles by rotations alone: nothing to check.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.results import Counts
from sgp_ros.errors import NumericalError
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import OnlinePrediction, Regression


def predict_soundly(
    regression: Regression, u: np.ndarray, f: np.ndarray, counts: Counts
) -> OnlinePrediction:
    """Predict; where rotations have lost a factor, compute it anew from the buffer first.

    A prediction that is unsound with a fresh factor too comes from the input: it repeats others.
    """
    prediction = regression.predict(u, f)
    if (
        not isinstance(regression, OnlineRegression)
        or regression.is_sound(prediction)
        or not regression.rotated
    ):
        return prediction
    try:
        regression.refresh()
    except NumericalError:
        return prediction
    again = regression.predict(u, f)
    counts.factor_rebuilt += regression.is_sound(again)
    return again


def check_factor(regression: Regression, counts: Counts) -> None:
    """Compare the factors with fresh ones, which then take their place."""
    if not isinstance(regression, OnlineRegression):
        return
    try:
        drift = regression.refresh()
    except NumericalError:
        return
    counts.factor_checks += 1
    counts.factor_drift = max(counts.factor_drift, drift)
