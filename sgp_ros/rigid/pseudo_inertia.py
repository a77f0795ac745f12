"""The pseudo-inertia of a link: a 4 x 4 matrix that is positive definite for real bodies.

With the density rho(x) of a body, `J = integral [x; 1] [x; 1]^T rho(x) dx`. Its upper block is
the second moment `Sigma = tr(I) / 2 1 - I` of the mass about the origin of the link, its last
column the first moment and the mass. Ten inertial parameters belong to some distribution of
positive mass if and only if J is positive definite, and J is linear in them (Wensing, Kim,
Slotine 2018, Linear matrix inequalities for physically consistent inertial parameter
identification, section III).
"""

from __future__ import annotations

import numpy as np

ROWS = (0, 1, 1, 2, 2, 2)
COLUMNS = (0, 0, 1, 0, 1, 2)
"""Entries of the inertia tensor in the order xx, xy, yy, xz, yz, zz."""


def inertia_tensor(parameters: np.ndarray) -> np.ndarray:
    """Return the inertia tensor about the origin of the link, (..., 3, 3) [kg m^2].

    Args:
        parameters: (..., 10) mass [kg], first moment x, y, z [kg m], and inertia tensor xx, xy,
            yy, xz, yz, zz about the origin of the link [kg m^2].
    """
    tensor = np.zeros((*parameters.shape[:-1], 3, 3))
    tensor[..., ROWS, COLUMNS] = parameters[..., 4:]
    tensor[..., COLUMNS, ROWS] = parameters[..., 4:]
    return tensor


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Return J of ten inertial parameters (..., 10), (..., 4, 4) [kg m^2, kg m, kg].

    Raises:
        ValueError: not ten parameters.
    """
    if parameters.shape[-1:] != (10,):
        raise ValueError(f'inertial parameters {parameters.shape}, expected (..., 10)')
    tensor = inertia_tensor(parameters)
    J = np.zeros((*parameters.shape[:-1], 4, 4))
    half_trace = 0.5 * np.trace(tensor, axis1=-2, axis2=-1)
    J[..., :3, :3] = half_trace[..., None, None] * np.eye(3) - tensor
    J[..., :3, 3] = J[..., 3, :3] = parameters[..., 1:4]
    J[..., 3, 3] = parameters[..., 0]
    return J


def inertial_parameters(J: np.ndarray) -> np.ndarray:
    """Return the ten parameters of pseudo-inertias (..., 4, 4), (..., 10): `I = tr(S) 1 - S`."""
    S = J[..., :3, :3]
    tensor = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    return np.concatenate([J[..., 3, 3, None], J[..., :3, 3], tensor[..., ROWS, COLUMNS]], axis=-1)


PSEUDO_BASIS = pseudo_inertia(np.eye(10))
"""(10, 4, 4): `J = sum_i parameters[i] PSEUDO_BASIS[i]`."""
PSEUDO_BASIS.flags.writeable = False


def is_consistent(parameters: np.ndarray) -> np.ndarray:
    """Whether parameters (..., 10) belong to a body of positive mass: J > 0, (...) of bool.

    J is brought to a unit diagonal first, which keeps its definiteness but takes away the units;
    its least eigenvalue must exceed rounding, 16 eps.
    """
    J = pseudo_inertia(parameters)
    diagonal = np.diagonal(J, axis1=-2, axis2=-1)
    is_positive = np.all(diagonal > 0.0, axis=-1) & np.all(np.isfinite(J), axis=(-2, -1))
    root = np.sqrt(np.where(is_positive[..., None], diagonal, 1.0))
    unit = np.where(
        is_positive[..., None, None], J / root[..., :, None] / root[..., None, :], np.eye(4)
    )
    least = np.linalg.eigvalsh(unit)[..., 0]
    return is_positive & (least > 16.0 * np.finfo(np.float64).eps)
