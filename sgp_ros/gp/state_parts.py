"""Names in the arrays of a state, of which each part has a prefix."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def part_of(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """Return the arrays whose names begin with `prefix`, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
