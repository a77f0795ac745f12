"""Laws of force that a formula states, as effects like any other.

    tau_x[elbow] = -a*abs(dq[elbow])**0.5*sign(dq[elbow])

Parameters that stand as factors are coefficients of columns, all others are the shape. The sign of
a velocity is its mean over a cell of the grid, and at rest a law with it holds the joint, as for
the built-in laws. `lag`, `play` and `delay` run over the grid of a recording.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from sgp_ros.physics.effect import Effect
from sgp_ros.physics.formula import Formula, read_formula
from sgp_ros.physics.grammar import MEMORY, TIME
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import LawParameter, Quantity, Value, relative_scales
from sgp_ros.physics.place import Place, Placed
from sgp_ros.physics.term import Motion

NAME = 'law'
_DRAWN = {'dq': 'velocity', 'q': 'position', 'ddq': 'acceleration', 'tau': 'effort', TIME: 'time'}
_PROBES = 64
_GREATEST = 1e60
"""Force per factor beyond which a formula is taken as so large: its square is finite."""
_BETWEEN = 4
"""Starts between the ends of a range, beside the stated one."""


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Where a formula is evaluated: a motion, and the parameters by name."""

    motion: SeenMotion
    numbers: Mapping[str, float | np.ndarray]


@dataclass(frozen=True, eq=False)
class _Still(Motion):
    """States at rest."""

    time: np.ndarray
    step: float = 1.0


_Signals = frozenset[tuple[str, str]]
_Signs = Callable[[_Signals], Callable[..., object]]


class FormulaLaw(Effect):
    """A law of force on one joint that a formula states.

    Args:
        formula: of the force.
        joint: that it acts on.
        parameters: of the formula.
        words: for people.
        is_open: whether a robot may have it or not, and its numbers are not known.
        price: what the choice of its formula among others takes [nats].
    """

    name = NAME

    def __init__(
        self, formula: Formula, joint: str, parameters: Sequence[LawParameter],
        words: str = 'a law of its own', *, is_open: bool = False, price: float = 0.0,
    ) -> None:  # fmt: skip
        self.law, self.joint, self.words, self.is_open = formula, joint, words, is_open
        self._price = price
        self.formula = f'tau_x[{joint}] = {formula.text}'
        self.source = 'stated by a formula'
        self.quantities = tuple(parameters)
        self.known = {p.name: p.start for p in parameters if p.is_known}
        self._own = {p.name: p for p in parameters}
        sought = formula.parameters - {*self.known}
        self.linear = formula.linear([n for n in self._own if n in sought])
        kinds = {kind for kind, _ in formula.signals}
        self.has_memory = bool(formula.functions & set(MEMORY))
        self.sees_acceleration = 'ddq' in kinds
        self.is_online = is_online(formula)
        self.drawn_over = _variable(formula, joint)
        self.is_dry = self._holds()

    @property
    def key(self) -> str:
        """Its formula: laws are told apart by what they state."""
        return f'{NAME} {self.formula}'

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return the parameters that are factors, in the order of the columns."""
        return tuple(self._own[n] for n in self.linear) or (Quantity('scale', '1'),)

    def shape_names(self, kind: str = '') -> tuple[str, ...]:
        """Return the parameters that are sought and no factors."""
        return tuple(n for n in self._own if n not in self.linear and n not in self.known)

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        """Return all columns where the law depends on an effort."""
        of_effort = any(kind == 'tau' for kind, _ in self.law.signals)
        return tuple(range(max(len(self.linear), 1))) if of_effort else ()

    def surprise(self, at: Placed) -> float:
        """Return what the choice of its formula takes [nats]."""
        return self._price

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether all parameters lie in their ranges."""
        values = self.report(at, motion)
        return all(p.low <= float(values[name]) <= p.high for name, p in self._own.items())

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return the values of the parameters."""
        named = self.known | dict(zip(self.linear, at.coefficients, strict=False))
        named |= dict(zip(self.shape_names(), at.shape, strict=False))
        return {name: float(named[name]) for name in self._own}

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return its joint, where that moves."""
        j = motion.tree.moving_names.index(self.joint)
        return [Place(j)] if j in motion.moving_joints else []

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return the stated starts, and places between the ends of their ranges."""
        grid = [self.values_of(name) for name in self.shape_names()]
        return np.array(list(itertools.product(*grid)), dtype=np.float64)

    def values_of(self, name: str) -> list[float]:
        """Return the start of a number and values in its range.

        Even ones, or even ratios where the range has one sign.
        """
        p = self._own[name]
        low, high = p.ends
        even = np.geomspace if low > 0.0 else np.linspace
        return [p.start, *even(low, high, 2 + _BETWEEN)[1:-1].tolist()]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        ends = np.array([self._own[name].ends for name in self.shape_names()]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return a few times the size of what cannot change its sign, else the range."""
        low, high = self.bounds(motion, place)
        return np.where(low >= 0.0, relative_scales(low, high, np.abs(shape)), high - low)

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return self.per_factor(motion, self.shape_numbers(shape))

    def shape_numbers(self, shape: np.ndarray) -> dict[str, float]:
        """Return all parameters that are no factors, by name."""
        return self.known | dict(zip(self.shape_names(), shape.tolist(), strict=True))

    def per_factor(
        self, motion: SeenMotion, numbers: Mapping[str, float | np.ndarray]
    ) -> np.ndarray:
        """Return the formula per factor, (n, m), the whole without, of numbers or rows (n,)."""
        names = motion.tree.moving_names
        force, n = self._compiled(names, _sign), len(motion.position)
        found = []
        for chosen in self.linear or ('',):
            ones = {name: float(name == chosen) for name in self.linear}
            with np.errstate(all='ignore'):
                x = force(_Seen(motion, {**numbers, **ones}))
            found.append(np.broadcast_to(np.asarray(x, dtype=np.float64), (n,)))
        x = np.nan_to_num(np.column_stack(found), nan=0.0, posinf=0.0, neginf=0.0)
        return np.clip(x, -_GREATEST, _GREATEST)

    def _compiled(self, names: Sequence[str], sign: _Signs) -> Callable[[_Seen], object]:
        """Return the force of a motion, given what stands for the sign of velocities."""

        def special(name: str, signals: _Signals) -> Callable[..., object] | None:
            if name in MEMORY:
                return _REMEMBERED[name]
            is_direction = name == 'sign' and {kind for kind, _ in signals} == {'dq'}
            return sign(signals) if is_direction else None

        return self.law.compiled(_parameter, lambda kind, joint: _signal(names, kind, joint),
                                 special)  # fmt: skip

    def _holds(self) -> bool:
        """Return whether it is dry friction: at rest it opposes either direction, mostly.

        The sign of one whose numbers are not known is not known either.
        """
        if 'sign' not in self.law.functions:
            return False
        names = sorted({self.joint, *(j for _, j in self.law.signals if j)})
        q, u = np.random.default_rng(0).uniform(-1.0, 1.0, (2, _PROBES, len(names)))
        still = np.zeros_like(q)
        rest = _Still(q, still, still, u, np.arange(float(_PROBES)))
        numbers = {name: p.start for name, p in self._own.items()}

        def sign(signals: _Signals) -> Callable[..., object]:
            own = float(signals == {('dq', self.joint)})
            return lambda seen, _speed: own * seen.numbers['']

        force = self._compiled(names, sign)
        with np.errstate(all='ignore'):
            up, down = (
                np.asarray(force(_Seen(rest, numbers | {'': s})), dtype=np.float64)  # type: ignore[arg-type]
                for s in (1.0, -1.0)
            )
        holds = (up < 0.0) & (down > 0.0)
        if self.is_open:
            holds |= (up > 0.0) & (down < 0.0)
        return bool(np.mean(holds) > 0.5)


def law_variable(text: str) -> str:
    """Return the variable over which a law, `tau_x[J] = ...`, is drawn."""
    left, _, right = text.partition('=')
    joint = left.partition('[')[2].rpartition(']')[0].strip('\'"')
    return _variable(read_formula(right, is_law=True), joint)


def _variable(formula: Formula, joint: str) -> str:
    """Return what a law sees of its own joint: velocity before position, and the time last."""
    own = {kind for kind, j in formula.signals if j in {joint, ''}}
    return next((name for kind, name in _DRAWN.items() if kind in own), 'position')


def is_online(formula: Formula) -> bool:
    """Return whether a law needs no more than one time of a motion, as a node sees it.

    A node changes efforts before it knows positions, so that a law takes either.
    """
    kinds = {kind for kind, _ in formula.signals}
    of_effort = 'tau' in kinds and bool(kinds & {'q', 'ddq'})
    return not (formula.functions & set(MEMORY) or TIME in kinds or of_effort)


def _parameter(name: str) -> Callable[[_Seen], object]:
    if name == TIME:
        return lambda seen: seen.numbers.get(name, seen.motion.time)
    return lambda seen: seen.numbers[name]


def _signal(names: Sequence[str], kind: str, joint: str) -> Callable[[_Seen], object]:
    j = names.index(joint)
    channel = {'q': 'position', 'dq': 'velocity', 'ddq': 'acceleration', 'tau': 'effort'}[kind]
    return lambda seen: getattr(seen.motion, channel)[:, j]


def _sign(_signals: _Signals) -> Callable[[_Seen, np.ndarray], np.ndarray]:
    return lambda seen, speed: seen.motion.direction_of(speed)


@njit(cache=True)
def _lagged(x: np.ndarray, ratio: float) -> np.ndarray:
    """Return x behind a first-order lag of `1 / ratio` steps, exact for straight pieces."""
    z = np.empty(len(x))
    z[0] = x[0]
    keep = np.exp(-ratio)
    for i in range(1, len(x)):
        slope = (x[i] - x[i - 1]) / ratio
        z[i] = x[i] - slope + (z[i - 1] - x[i - 1] + slope) * keep
    return z


@njit(cache=True)
def _played(x: np.ndarray, half: float) -> np.ndarray:
    z = np.empty(len(x))
    z[0] = x[0]
    for i in range(1, len(x)):
        z[i] = min(max(z[i - 1], x[i] - half), x[i] + half)
    return z


def remembered(name: str, motion: SeenMotion, x: np.ndarray, number: float) -> np.ndarray:
    """Return a function that remembers, of `MEMORY`, of a signal x (n,) on the grid, (n,)."""
    return np.asarray(_REMEMBERED[name](_Seen(motion, {}), x, number))


def _row(x: object, seen: _Seen) -> np.ndarray:
    return np.ascontiguousarray(
        np.broadcast_to(np.asarray(x, dtype=np.float64), (len(seen.motion.position),))
    )


def _lag(seen: _Seen, x: object, time_constant: float) -> np.ndarray:
    return np.asarray(_lagged(_row(x, seen), seen.motion.step / max(time_constant, 1e-9)))


def _play(seen: _Seen, x: object, width: float) -> np.ndarray:
    return np.asarray(_played(_row(x, seen), 0.5 * width))


def _delay(seen: _Seen, x: object, delay: float) -> np.ndarray:
    time = seen.motion.time
    return np.interp(time - delay, time, _row(x, seen))


_REMEMBERED: dict[str, Callable[..., object]] = {'lag': _lag, 'play': _play, 'delay': _delay}
