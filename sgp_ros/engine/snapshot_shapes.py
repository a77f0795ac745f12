"""Shapes of the arrays of a saved model, checked before compiled loops go over them unchecked."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from sgp_ros.errors import ConfigError

_GREATEST = 1e150
"""Above this a number has no square."""
_COMPLEMENT = {
    'mean': 'c', 'covariance': 'c c', 'products': 'c 3 4', 'error_covariance': 'c c',
    'past': '* c', 'counts': '2', 'last_ns': '*',
}  # fmt: skip
_REGRESSION = {
    'U': 'n d', 'data': 'n k q', 'weights': 'n', 'counts': '2', 'turn': '', 'rotated': '',
    'total_R': 'r p', 'total_z': 'r', 'basis_total_R': 'b p', 'basis_total_z': 'b',
    'basis_unresolved': '', 'basis_sets': '',
    r'(factor\d+)_L': '\\1f \\1f', r'(factor\d+)_S': 'n *', r'factor\d+_white': 'n *',
    'retention_precision': '* *', 'retention_S': 'n *', 'retention_(gap|neighbour)': 'n',
    r'basis_(set\d+)_(inducing_L|R|data_R)': '\\1m \\1m',
    r'basis_(set\d+)_(inducing_(S|white)|C|data_C)': '\\1m *',
    r'basis_(set\d+)_outputs': '\\1o', r'basis_(set\d+)_inputs': '\\1m d',
    r'basis_(set\d+)_tally': '3', r'basis_(set\d+)_residual_R': '\\1o \\1r p',
    r'basis_(set\d+)_residual_z': '\\1o \\1r',
}  # fmt: skip
"""Name of an array to its axes: a number, a letter of one length within a model, or any length."""


def require_arrays(snapshot: Mapping[str, np.ndarray], k: int, p: int) -> None:
    """Refuse arrays of other kinds, shapes or ranges than a saved model has.

    Args:
        snapshot: of `take_snapshot`.
        k: number of joints.
        p: number of parameters.

    Raises:
        ConfigError: such an array.
    """
    lengths: dict[str, int] = {}
    for name, array in snapshot.items():
        if name == 'json':
            continue
        is_number = array.dtype.kind in 'biu' or array.dtype == np.float64
        greatest = np.inf if name.endswith('_gap') else _GREATEST  # that of a sample alone
        if not is_number or not (np.abs(array, dtype=np.float64) <= greatest).all():
            raise ConfigError(
                f'a snapshot whose {name} holds {array.dtype}', f'finite numbers to {_GREATEST:g}'
            )
        model, _, part = name.partition('.')
        lengths |= {f'{model} k': k, f'{model} p': p, f'{model} q': p + 1}
        _require_shape(name, array, _COMPLEMENT if model == 'complement' else _REGRESSION, lengths)
        if name.endswith('_noise') and (array.shape != (k,) or not (array > 0.0).all()):
            raise ConfigError(
                f'a snapshot with {name} = {array.tolist()}', f'{k} positive numbers'
            )
        places = {
            'neighbour': lengths.get(f'{model} n', 0) - 1,
            'outputs': k - 1,
            'rotated': 2**53,
        }
        most = places.get(part.rpartition('_')[2])
        if most is not None and not ((array >= 0) & (array <= most)).all():
            raise ConfigError(f'a snapshot whose {name} is out of range', f'0 to {most}')


def _require_shape(
    name: str, array: np.ndarray, axes_of: Mapping[str, str], lengths: dict[str, int]
) -> None:
    """Compare a shape with the axes of an array, of which those seen first set the lengths."""
    model, _, part = name.partition('.')
    found = next((m for m in (re.fullmatch(x, part) for x in axes_of) if m), None)
    if found is None or (array.size == 0 and part.endswith('_inputs')):
        return
    axes = found.expand(axes_of[found.re.pattern]).split()
    is_like = len(axes) == array.ndim
    for axis, length in zip(axes, array.shape, strict=False):
        known = int(axis) if axis.isdecimal() else lengths.setdefault(f'{model} {axis}', length)
        is_like &= axis == '*' or known == length
    if not is_like:
        raise ConfigError(f'a snapshot whose {name} has the shape {array.shape}', ' x '.join(axes))
