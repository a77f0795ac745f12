"""Parts of an effect: parameters, the form of its term, its first order."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.place import Place, Placed

Value = float | str

_ALL_OFF = 1.1
"""Part of a stated number that a law may take off: all of it, if its unit is a tenth off."""
COULOMB, VISCOUS = 'coulomb', 'viscous'
"""Kinds of friction: over the direction of the motion, and over its velocity."""


def leaves_some(quantity: Quantity, at: Placed, motion: SeenMotion) -> bool:
    """Return whether a law of one coefficient is one, beside what the nominal robot states of it.

    That may be too much: the law then takes a part of it off, or all, with an error.

    Args:
        quantity: its number, which a joint may state.
        at: the law.
        motion: with the nominal robot.
    """
    stated = motion.stated_number(quantity.joint_number, at.place.joint)
    return bool(at.coefficients[0] > -_ALL_OFF * stated)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A parameter of an effect, in the words of the schema.

    Attributes:
        name: as in `diagnosis.json`.
        unit: on a revolute joint.
        low: least value that makes sense.
        is_positive: whether a stated value must be above zero.
        is_optional: whether a model does without.
        is_scored: whether estimates are compared with the truth where worlds are drawn.
        kinds: the kind of the effect that it belongs to; empty for all.
        is_sought: whether a diagnosis states the least of it that the recording would show.
        neutral: value at which the effect vanishes, if the number states its size.
        joint_number: number of a joint that it is in other programs, of a law with further ones
            the nearest; empty for none.
    """

    name: str
    unit: str
    low: float = -math.inf
    is_positive: bool = False
    is_optional: bool = False
    is_scored: bool = True
    kinds: tuple[str, ...] = ()
    is_sought: bool = False
    neutral: float = 0.0
    joint_number: str = ''

    def of_kind(self, kind: str) -> Quantity:
        """Return the quantity of a kind of the effect: viscous levels are per velocity."""
        is_level = kind == VISCOUS and self.unit == 'N m'
        return replace(self, unit='N m s/rad') if is_level else self

    def on(self, *, is_prismatic: bool) -> Quantity:
        """Return the quantity with its unit on a joint of this kind."""
        return replace(self, unit=self.unit_on(is_prismatic=is_prismatic))

    def unit_on(self, *, is_prismatic: bool) -> str:
        """Return the unit on a joint of this kind; a phase is an angle on any."""
        if not is_prismatic or self.name == 'phase':
            return self.unit
        return linear_unit(self.unit)


_SPREAD = 30.0
"""Factor around its start within which a parameter without range is sought."""


@dataclass(frozen=True)
class LawParameter(Quantity):
    """A parameter of a law, with its unit as it is on the law's own joint.

    Attributes:
        start: value from which a search starts.
        high: greatest value that makes sense.
        is_known: whether the value is part of the law.
    """

    start: float = 1.0
    high: float = math.inf
    is_known: bool = field(default=False, kw_only=True)

    def of_kind(self, kind: str) -> Quantity:
        return self

    def unit_on(self, *, is_prismatic: bool) -> str:
        return self.unit

    @property
    def ends(self) -> tuple[float, float]:
        """Range of a search, finite."""
        reach = max(abs(self.start), 1e-6)
        low = self.start / _SPREAD if self.start > 0.0 else self.start - _SPREAD * reach
        high = self.start + _SPREAD * reach
        return (
            self.low if math.isfinite(self.low) else low,
            self.high if math.isfinite(self.high) else high,
        )


def linear_unit(unit: str) -> str:
    """Return the unit on a prismatic joint of what has this unit on a revolute one."""
    if unit == 'kg m2':
        return 'kg'
    return unit.replace('N m', 'N').replace('rad', 'm').replace('revolution', 'm')


@dataclass(frozen=True, slots=True, eq=False)
class SmallEffect:
    """An effect whose shape says all, to first order in its size: where a search starts.

    Attributes:
        columns: from motion, place and one of the effect's `starts` to forces per coefficient, as
            those of an `Effect`.
        shape: from that start and coefficients (m,) to the shape of the effect itself, (s,).
        turned: from a shape to another, (s,), that a search starts from too, where a law has two
            optima; None for none.
    """

    columns: Callable[[SeenMotion, Place, np.ndarray], np.ndarray]
    shape: Callable[[np.ndarray, np.ndarray], np.ndarray]
    turned: Callable[[Placed], np.ndarray | None] = lambda _at: None


@dataclass(frozen=True, slots=True, eq=False)
class OwnMotion:
    """Motion of single joints, arrays of any one shape.

    Attributes:
        q: position [rad or m].
        v: velocity [rad/s or m/s].
        a: acceleration [rad/s^2 or m/s^2].
        s: direction of the motion: sign(v), its mean over a cell of the grid, or a smooth form.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    s: np.ndarray


@dataclass(frozen=True, slots=True)
class TermForm:
    """How a law enters a robot YAML under `terms`: `tau = ... + c * column`.

    Attributes:
        name: of the term.
        names: of its coefficients, each after the name of the joint.
        columns: indices of the law's own coefficients.
        sign: of the term's coefficients over the law's: 1 for what takes effort from the motor.
        is_dissipative: no coefficient of it is negative in a real machine.
        dynamics: attribute of `<dynamics>` in a URDF that states it; empty for none.
        is_assumed: every joint of a robot from a URDF has it, unless its YAML states `terms`.
    """

    name: str
    names: tuple[str, ...]
    columns: tuple[int, ...] = (0,)
    sign: float = 1.0
    dynamics: str = ''
    is_dissipative: bool = False
    is_assumed: bool = False


def propagated(
    coefficients: Callable[[Mapping[str, float]], np.ndarray],
    numbers: Mapping[str, float],
    std: Mapping[str, float],
) -> np.ndarray:
    """Return the standard deviations of coefficients from those of the numbers behind them, (m,).

    Errors of the numbers count as independent, to first order:
    `var c_i = sum_k (dc_i / dx_k)^2 var x_k`. Infinite where one that matters is not known, or
    none does.
    """
    variance = np.zeros(len(coefficients(numbers)))
    for name, value in numbers.items():
        step = 1e-6 * max(abs(value), 1.0)
        ends = (coefficients({**numbers, name: value + sign * step}) for sign in (1.0, -1.0))
        slope = np.subtract(*ends) / (2.0 * step)
        matters = slope != 0.0
        variance[matters] += (slope[matters] * std.get(name, math.inf)) ** 2
    return np.asarray(np.sqrt(np.where(variance > 0.0, variance, math.inf)))


def relative_scales(low: np.ndarray, high: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return the scales (s,) of times, gaps and other sizes in a search: a few times the size."""
    return np.asarray(np.minimum(high - low, np.maximum(4.0 * shape, 1e-3 * high)))
