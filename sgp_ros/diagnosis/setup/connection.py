"""Errors of a connection with their numbers, and their rivals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.criteria import COUNTED_SHARE, PER_EFFECT, PER_PARAMETER
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.errors import Hypothesis
from sgp_ros.diagnosis.setup.unknowns import Agreement


@dataclass(frozen=True, eq=False)
class Tried:
    """A hypothesis with its numbers.

    Attributes:
        hypothesis: what is wrong.
        numbers: (m,) [units of the hypothesis].
        std: (m,) standard deviations.
        correction: that undoes it, and what was found before it.
        agreement: of the recording that is corrected so.
        needed: evidence less its price that is lost without it, all others searched anew [nats].
    """

    hypothesis: Hypothesis
    numbers: np.ndarray
    std: np.ndarray
    correction: Correction
    agreement: Agreement
    needed: float = math.inf

    @property
    def remedy(self) -> str:
        """Remedy for the error."""
        values = dict(zip(self.hypothesis.names, map(float, self.numbers), strict=True))
        return self.hypothesis.remedy(values)

    @property
    def is_beyond(self) -> bool:
        """Whether its numbers are more than how signals are sampled."""
        return not self.numbers.size or float(np.abs(self.numbers).max()) >= self.hypothesis.least

    @property
    def worth(self) -> float:
        """Evidence less the price of the hypothesis [nats]."""
        return self.agreement.evidence - price_of_one(self.hypothesis)


Rivals = dict[tuple[str, str, tuple[str, ...]], tuple[Tried, ...]]
"""Of each error, by its key, best first."""


@dataclass(frozen=True, eq=False)
class Connection:
    """Errors of the connection, with their rivals.

    Attributes:
        errors: in the order in which they were found.
        rivals: of each, best first.
        start: agreement of the recording as it is.
        end: agreement once errors, and physics that hides them, are undone.
        delay_std: what these add to the uncertainty of a delay of the targets [s].
    """

    errors: tuple[Tried, ...]
    rivals: tuple[tuple[Tried, ...], ...]
    start: Agreement
    end: Agreement
    delay_std: float = 0.0

    @property
    def is_enough(self) -> bool:
        """Whether no error was found, and no residual counts as physics at any joint."""
        return not self.errors and float(self.end.left.max()) <= COUNTED_SHARE

    def without(self, i: int) -> Connection:
        """Return the errors but one, with their numbers as they are."""
        rivals = self.rivals[:i] + self.rivals[i + 1 :]
        return replace(self, errors=undoing(self.errors[:i] + self.errors[i + 1 :]), rivals=rivals)


def undoing(errors: Sequence[Tried]) -> tuple[Tried, ...]:
    """Return errors that are undone one after the other, with their numbers as they are."""
    kept: list[Tried] = []
    for e in errors:
        before = kept[-1].correction if kept else Correction.none(len(e.correction.scale))
        kept.append(replace(e, correction=e.hypothesis.applied(before, e.numbers)))
    return tuple(kept)


def price_of_one(h: Hypothesis) -> float:
    """Return the price of an error and of its numbers [nats]."""
    return PER_EFFECT + PER_PARAMETER * len(h.names)
