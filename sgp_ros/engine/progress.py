"""Motion between two fits of hyper-parameters: a robot that rests learns nothing new for them.

A buffer full of rest repeats one sample. It determines the noise at that place, but neither the
noise of a motion nor how Z changes with its inputs, and a fit to it forgets what an earlier motion
told of both. So samples count for the next fit only at new places, and it is not due before a
share of those since the last one do.
"""

from __future__ import annotations

from typing import Any

from sgp_ros.engine.windows import Equation

SHARE = 0.25
"""Of the samples between two fits that have to be at new places. A motion has them also where
neighbouring windows differ by less than their noise; a rest, or creep within the resolution of an
encoder, has next to none."""
_BOTH = 2.0


class Progress:
    """Counts the equations at new places.

    A place is new once a joint is further from where it was counted last than noise may separate
    two positions of one place: twice the largest distance since then of a sample from the
    polynomial that follows the others of its window.

    Attributes:
        count: equations at new places since the last fit; None before the first one.
        place: k positions where the last one was counted; empty without one.
        noise: k largest distances since then.
    """

    def __init__(self) -> None:
        self.count: int | None = None
        self.place: list[float] = []
        self.noise: list[float] = []

    def take(self, equation: Equation) -> None:
        """Take an equation that was learned. O(k), on lists: arrays of few joints take longer."""
        position = equation.motion.position[0].tolist()
        distance = equation.roughness[0, : len(position)].tolist()
        if not self.place:
            self.place, self.noise = position, distance
            return
        self.noise = list(map(max, self.noise, distance))
        for q, place, noise in zip(position, self.place, self.noise, strict=True):
            if abs(q - place) > _BOTH * noise:
                self.place, self.noise = position, distance
                if self.count is not None:
                    self.count += 1
                return

    def is_enough(self, period: int) -> bool:
        """Return whether there are enough for a fit every `period` samples; always for the first.

        Args:
            period: setting `refit.period`.
        """
        return self.count is None or self.count >= SHARE * period

    def begin(self) -> None:
        """Count anew: a fit is asked for."""
        self.count = 0

    def state(self) -> list[Any]:
        """Return everything as plain values; `restore` takes it back."""
        return [self.count, self.place, self.noise]

    def restore(self, state: list[Any]) -> None:
        """Continue exactly where `state` was taken."""
        count, place, noise = state
        self.count = None if count is None else int(count)
        self.place, self.noise = list(map(float, place)), list(map(float, noise))
