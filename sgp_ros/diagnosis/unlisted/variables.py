"""Variables that a force may depend on, in a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import remembered
from sgp_ros.physics.motion import SeenMotion, Structure

DEGREE = 3
"""Of splines over a variable."""
MEMORY = 'T'
"""Parameter of what remembers."""
SLIP, STRETCH, LEAD = 'slip', 'stretch', 'lead'
"""Distances of a joint ahead of its lag, and of its play; and its position some time ahead."""
BEHIND = {SLIP: 'lag', STRETCH: 'play'}
"""The memory that these two are ahead of."""
RATIO = 'R'
"""Parameter of a sum of two joints."""
FORCES = {'m': 'N', 'rad': 'N m'}
"""Unit of the force on a joint, by that of its position."""


@dataclass(frozen=True, slots=True)
class Variable:
    """Variable of a force: `q` or `dq` of a joint, of two joints, or an earlier value of it.

    A slip is what a joint is ahead of its lag, as the spring of a spring and damper in series is;
    a stretch what it is ahead of its play, as one in series with dry friction; a lead `q + T dq`,
    as the error of a controller whose target rests. The motor torque `tau` is one, too.

    Attributes:
        kind: `q`, `dq` or `tau`.
        index, joint: of the joint, and its name.
        other: index, name and weight of a joint that is added; None for none.
        memory: `lag`, `delay`, `slip`, `lead` or `play`, `stretch`, with its number [s, or unit of
            q]; None for none.
    """

    kind: str
    index: int
    joint: str
    other: tuple[int, str, float] | None = None
    memory: tuple[str, float] | None = None

    @property
    def text(self) -> str:
        """As it stands in a formula."""
        if self.memory:
            now, name = self._signal(self.joint), self.memory[0]
            if name == LEAD:
                return f'({now} + {MEMORY}*d{now})'
            past = f'{BEHIND.get(name, name)}({now}, {MEMORY})'
            return f'({now} - {past})' if name in BEHIND else past
        if self.other is None:
            return self._signal(self.joint)
        _, name, weight = self.other
        sign, times = ('+', f'{RATIO}*') if self.is_weighted else ('+' if weight > 0 else '-', '')
        return f'({self._signal(self.joint)} {sign} {times}{self._signal(name)})'

    @property
    def is_of_width(self) -> bool:
        """Whether the number of its memory is a width, not a time."""
        return self.memory is not None and self.memory[0] in {'play', STRETCH}

    @property
    def is_weighted(self) -> bool:
        """Whether the other joint is added with a weight that is sought."""
        return self.other is not None and abs(self.other[2]) != 1.0

    def _signal(self, joint: str) -> str:
        return f'{self.kind}[{joint}]' if joint.isidentifier() else f'{self.kind}["{joint}"]'

    @property
    def is_plain(self) -> bool:
        """Whether it is of one joint, now."""
        return self.other is None and self.memory is None

    def unit(self, tree: Structure) -> str:
        """Return its unit."""
        length = 'm' if tree.is_prismatic[self.index] else 'rad'
        return {'q': length, 'dq': f'{length}/s', 'tau': FORCES[length]}[self.kind]

    def ratio_unit(self, tree: Structure) -> str:
        """Return the unit of the weight of another joint that is added."""
        assert self.other is not None
        lengths = ['m' if tree.is_prismatic[i] else 'rad' for i in (self.index, self.other[0])]
        return '1' if lengths[0] == lengths[1] else '/'.join(lengths)

    def knots(self, motion: SeenMotion, pieces: int) -> np.ndarray:
        """Return the knots of a spline over it, (pieces + 7,).

        Half way from even ones to quantiles: the ends of a range are seldom visited, and hold most
        information. Knots of velocities are denser towards rest, where friction changes.
        """
        x = self.values(motion)
        inner = np.quantile(x, np.linspace(0.0, 1.0, pieces + 1))
        u = np.linspace(-1.0, 1.0, pieces + 1)
        if self.kind == 'dq' and x.min() < 0.0 < x.max():
            inner = u * np.abs(u) * np.where(u < 0.0, -x.min(), x.max())
        else:
            inner = 0.5 * (inner + np.linspace(inner[0], inner[-1], pieces + 1))
        return np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])

    def is_of(self, s: EffectAt) -> bool:
        """Return whether an effect is a function of it, if it is of the effect's own joint."""
        over = {'q': 'position', 'dq': 'velocity', 'tau': 'effort'}[self.kind]
        return self.is_plain and s.place.joint == self.index and s.effect.drawn_over == over

    @property
    def words(self) -> str:
        """As it stands in a sentence."""
        what = {'q': 'position', 'dq': 'velocity', 'tau': 'motor torque'}[self.kind]
        if self.memory:
            return f'{what} of {self.joint} after a {self.memory[0]}'
        if self.other is None:
            return f'{what} of {self.joint}'
        _, other, weight = self.other
        if self.is_weighted:
            return f'{what} of {self.joint} plus {weight:.2g} times that of {other}'
        return f'{"sum" if weight > 0 else "difference"} of the {what} of {self.joint} and {other}'

    def values(self, motion: SeenMotion) -> np.ndarray:
        """Return it in a motion, (n,)."""
        of = {'q': motion.position, 'dq': motion.velocity, 'tau': motion.effort}[self.kind]
        x = np.asarray(of[:, self.index])
        if self.memory:
            name, number = self.memory
            if name == LEAD:
                return x + number * motion.velocity[:, self.index]
            past = remembered(BEHIND.get(name, name), motion, x, number)
            return x - past if name in BEHIND else past
        return x if self.other is None else x + self.other[2] * of[:, self.other[0]]
