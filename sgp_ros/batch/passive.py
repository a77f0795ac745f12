"""Whether the fit of a robot with passive joints found more than zero.

The equation of a passive joint is `0 = f(u) W`. It holds best for W = 0, and its learned noise can
shrink with W: the likelihood of such a fit has no bound, but where other joints hold W up.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from sgp_ros.batch.fit import FittedCoefficients
from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.errors import NumericalError
from sgp_ros.rigid.base_parameters import BaseParameters
from sgp_ros.robots.robot import Robot

_LEVEL = 1e-3
"""Chance that W = 0 is taken for more. A passive joint that swings under gravity is thousands of
times beyond its quantile."""


def require_balance(
    fitted: FittedCoefficients, base: BaseParameters, data: FilteredData, robot: Robot
) -> None:
    """Refuse a fit that collapsed: what moves a passive joint cannot be told from zero.

    A chi-square test of all base parameters `C w` in the equation of the joint at once.

    Args:
        fitted: W of the physics alone.
        base: combinations that the recording determines.
        data: rows of the fit.
        robot: whose passive joints are judged.

    Raises:
        NumericalError: the fit found nothing in the equation of a passive joint.
    """
    variance = np.diag(fitted.covariance)[fitted.is_identifiable]
    is_sound = bool(np.isfinite(fitted.mean).all() and np.all(variance > 0.0))
    passive = [j for j, joint in enumerate(robot.joints) if not joint.is_actuated]
    empty = [j for j in passive if not (is_sound and _is_found(fitted, base, data, j))]
    if is_sound and not empty:
        return
    names = [robot.joint_names[j] for j in empty]
    raise NumericalError(
        'the fit of the physics failed: its coefficients do not differ from zero'
        + (f', with passive joints {names}' if names else ''),
        'efforts that determine the coefficients',
        'lock passive joints in the robot file, or drive the others harder',
    )


def _is_found(
    fitted: FittedCoefficients, base: BaseParameters, data: FilteredData, joint: int
) -> bool:
    columns = np.asarray(base.independent, dtype=np.int64)
    length = np.linalg.norm(data.F[:, joint, columns], axis=0)
    rows = np.flatnonzero(length > base.tolerance * base.scale[columns])
    if not len(rows):
        return True
    C = base.combinations[rows]
    value, spread = C @ fitted.mean, C @ fitted.covariance @ C.T
    size = np.sqrt(np.maximum(np.diag(spread), np.finfo(float).tiny))
    ratio = value / size
    square = float(ratio @ np.linalg.pinv(spread / np.outer(size, size)) @ ratio)
    return square > float(special.chdtri(len(rows), _LEVEL))
