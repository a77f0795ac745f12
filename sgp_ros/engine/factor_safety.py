"""Rebuilds a factor that rounding has lost, and measures how far a sound one has drifted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sgp_ros.errors import NumericalError

if TYPE_CHECKING:
    import numpy as np

    from sgp_ros.core.online import OnlineRegression
    from sgp_ros.core.online_prediction import OnlinePrediction
    from sgp_ros.engine.results import Counts


def predict_soundly(
    regression: OnlineRegression, u: np.ndarray, f: np.ndarray, counts: Counts
) -> OnlinePrediction:
    """Predict; where rotations have lost a factor, compute it anew from the buffer first.

    A prediction that is unsound with a fresh factor too comes from the input: it repeats others.
    """
    prediction = regression.predict(u, f)
    if regression.is_sound(prediction) or not regression.rotated:
        return prediction
    try:
        regression.refresh()
    except NumericalError:
        return prediction
    again = regression.predict(u, f)
    counts.factor_rebuilt += regression.is_sound(again)
    return again


def check_factor(regression: OnlineRegression, counts: Counts) -> None:
    """Compare the factors with fresh ones, which then take their place."""
    try:
        drift = regression.refresh()
    except NumericalError:
        return
    counts.factor_checks += 1
    counts.factor_drift = max(counts.factor_drift, drift)
