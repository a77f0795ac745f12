"""How a recording is filtered."""

from __future__ import annotations

from dataclasses import dataclass

VELOCITY_SOURCES = ('measured', 'position')


@dataclass(frozen=True, slots=True)
class FilterPlan:
    """How a recording is filtered.

    Attributes:
        cutoff: of the low-pass that every column and the target pass [Hz].
        state_cutoff: of the light smoothing of the states, well above `cutoff` [Hz].
        decimation: every how many samples a row is kept.
        velocity_source: `measured`, or `position` to differentiate.
    """

    cutoff: float
    state_cutoff: float
    decimation: int
    velocity_source: str = 'position'
