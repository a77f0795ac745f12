"""Formulas for a smooth force, those that fit its data best first.

A formula is a text of `sentences` in the variable of the smooth force, times its factor:

    tau_x[elbow] = (a*tanh((q[elbow] - x0)/w0) + d)*sign(dq[elbow])

All texts are compared with the curve of its data (`curves`); the best become laws with units.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.criteria import PER_PARAMETER, PER_UNUSUAL
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.unlisted.curves import Curve, Followed, follow, hats, in_position
from sgp_ros.diagnosis.unlisted.sentences import (
    COEFFICIENTS,
    of_position,
    of_velocity,
    smoothed,
    sums,
)
from sgp_ros.diagnosis.unlisted.shapes import SLOWEST, SMOOTHED, UNITS, SmoothForce, smooth_of
from sgp_ros.diagnosis.unlisted.variables import FORCES, MEMORY, RATIO, Variable
from sgp_ros.physics.formula import Formula, read_formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion

PER_PIECE = 0.5
"""Price of each number, name and operation of a formula [nats]."""
NAMELESS = 'a law found from the data'
NEAREST = {
    'a*X/(1 + (X/v0)**2)': 'an eddy-current brake',
    'a*abs(X)*X': 'quadratic drag',
    'a*X**3': 'a cubic law',
    'a*sqrt(abs(X))*sign(X)': 'drag that grows with the root of the speed',
    'a*X**2': 'a square law of one direction, such as wind',
    'a*tanh(X/v0)': 'friction that is smooth at rest',
    'a*max(X, 0)': 'a one-way damper',
    'a*min(X, 0)': 'a one-way damper',
    'a*X + b*(X - x0)**3': 'a hardening or softening spring',
    'a*(X - x0)**3': 'a hardening spring',
    'a*tanh((X - x0)/w0)': 'a spring that saturates',
    'a*exp(X/w0)': 'a spring that stiffens exponentially',
    'a*exp(-X/w0)': 'a spring that stiffens exponentially',
    'a*max(X - x0, 0)': 'a one-sided spring',
    'a*max(x0 - X, 0)': 'a one-sided spring',
    'a*max(X - x0, 0)**2': 'a soft contact',
    'a*max(x0 - X, 0)**2': 'a soft contact',
    'a*max(abs(X - x0) - w0, 0)*sign(X - x0)': 'a spring with slack',
    'a*((o0 - X)/r)**(-p0)': 'a gas spring or a magnet',
    'a*((X - u0)/r)**(-p0)': 'a gas spring or a magnet',
    'a*exp(-((X - x0)/w0)**2) sign': 'friction near one position',
    'a*X speed': 'damping that depends on the position',
    'a*sin(n0*(X - x0))**2 speed': 'a damper on a crank',
    'a*sin(n0*X) + b*cos(n0*X)': 'a slow sine wave, such as a weight on an arm or a magnet',
    'a*sin(n0*(X - x0)) + b*sin(n0*(X - x0))/sqrt(1 + e0*cos(n0*(X - x0)))':
        'a spring between two points of a linkage',
}  # fmt: skip
"""Text (without a constant) and factor to the nearest known physics."""
_OF_GATE = {gate: 'sign' if gate == 'soft' else gate for gate in UNITS}
_WAVES = (0.15, 4.5)
"""Periods of a sine within the range that was seen, least and greatest."""
_WIDE = 5.0
"""Range in which some part of every formula is not zero, in parts of the greatest value."""
_SUMMED = 3
"""Best texts of one term to which a second one is added."""
_PIECES = 100
"""Of a curve, even."""
_NARROWEST, _WIDEST = 1.0 / _PIECES, 3.0
"""Widths in parts of the range that was seen; a curve shows nothing narrower than its pieces."""


@dataclass(frozen=True, slots=True)
class Range:
    """Observed range of a variable."""

    low: float
    high: float
    unit: str

    @classmethod
    def of_variable(cls, variable: Variable, motion: ObservedMotion) -> Range:
        """Return that of a variable in a motion."""
        x = variable.values(motion)
        return cls(float(x.min()), float(x.max()), variable.unit(motion.tree))

    @property
    def span(self) -> float:
        """Width."""
        return self.high - self.low

    @property
    def size(self) -> float:
        """Greatest absolute value."""
        return max(abs(self.low), abs(self.high))

    def ends(self, name: str) -> tuple[float, float, str]:
        """Return the ends of a parameter that is not a coefficient, and its unit."""
        span, turn = self.span, 2.0 * np.pi / self.span
        return {
            'x': (self.low - 0.25 * span, self.high + 0.25 * span, self.unit),
            'w': (_NARROWEST * span, _WIDEST * span, self.unit),
            'v': (SLOWEST * self.size, _WIDEST * self.size, self.unit),
            'n': (_WAVES[0] * turn, _WAVES[1] * turn, f'1/{self.unit}'),
            'p': (0.05, 6.0, '1'),
            'o': (self.high + 0.02 * span, self.high + _WIDEST * span, self.unit),
            'u': (self.low - _WIDEST * span, self.low - 0.02 * span, self.unit),
            'e': (-0.95, 0.95, '1'),
            'r': (self.size, self.size, self.unit),
        }[name[0]]


class FoundLaw(FormulaLaw):
    """A formula in place of a smooth force, with the numbers that a search starts from."""

    has_chosen_form = True

    def __init__(
        self, smooth: SmoothForce, text: str, formula: Formula, joint: str,
        parameters: Sequence[LawParameter], words: str, price: float,
    ) -> None:  # fmt: skip
        super().__init__(formula, joint, parameters, words, is_open=True, price=price)
        self.smooth, self.text = smooth, text
        if not smooth.is_of_own_speed:
            self.is_dry = smooth.is_dry

    def starts(self, _motion: SeenMotion, _place: Place) -> np.ndarray:
        """Return the numbers that follow the data."""
        return np.array([[self._own[n].start for n in self.shape_names()]])


def formulas(
    smooth: SmoothForce, motion: ObservedMotion, curve: Curve, floor: float, count: int
) -> Iterator[FoundLaw]:
    """Yield formulas that follow the data of a smooth force best at their price, best first.

    Args:
        smooth: with variable and factor.
        motion: of the recording.
        curve: of its data, see `curve_of`.
        floor: sum of squares that errors of signals and filters may leave.
        count: of texts.
    """
    seen, noise = Range.of_variable(smooth.variable, motion), curve.rest + floor

    def tried(some: Iterable[str], near: Mapping[str, float]) -> Iterator[_Tried]:
        for text in some:
            formula = in_position(text)
            shape = [n for n in formula.parameters if n not in COEFFICIENTS]
            followed = follow(formula, curve, {n: seen.ends(n)[:2] for n in shape}, near)
            if followed is not None:
                left = (followed.left + noise) / (curve.size + noise)
                freedom = PER_PARAMETER * len(formula.parameters - {'r'})
                price = freedom + PER_PIECE * pieces(formula)
                yield 0.5 * ROWS * math.log(left) + price, text, followed

    found = sorted(tried(texts(smooth), {}), key=lambda f: f[0])
    for _, text, followed in [f for f in found if ' + b' not in f[1]][:_SUMMED]:
        term, is_position = text.removesuffix(' + d'), smooth.variable.kind == 'q'
        found += tried(sums(term, is_position=is_position), followed.numbers)
    found.sort(key=lambda f: f[0])
    for _, text, followed in found[:count]:
        yield law(smooth, motion, seen, text, followed.numbers)


_Tried = tuple[float, str, Followed]
"""Worth of a text [nats, less is better], the text, and how it follows the curve."""
ROWS = 100.0
"""Rows that count as independent, as everywhere where models are compared."""


def curve_of(model: Model, joint: int) -> Curve:
    """Return the curve of the smooth force that a model has at a joint.

    Of the joint's own velocity it is one of the force itself, with a jump at rest or without.
    """
    placed, smooth = smooth_of(model, joint)
    own = model.forces[[s is placed for s in model.effects].index(True)][:, joint]
    return Curve.of(*nodes_of(smooth, model), own + model.residual[:, joint])


def nodes_of(smooth: SmoothForce, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (p,) of the variable of a smooth force, and the rows of forces there (N, p)."""
    equations = model.frame.equations
    motion = equations.motion
    factor = np.ones(1) if smooth.is_of_own_speed else smooth.factors(motion)

    def rows(force: np.ndarray) -> np.ndarray:
        return equations.compact(force * factor[:, None], smooth.joint, is_inertial=False)

    nodes = np.unique(smooth.variable.knots(motion, _PIECES))
    return nodes, hats(nodes, rows, smooth.variable.values(motion))


def pieces(formula: Formula) -> float:
    """Return the number of numbers, names and operations of a formula."""
    return formula.folded(lambda _node: 1.0, lambda _node, parts: 1.0 + sum(parts))


def texts(smooth: SmoothForce) -> list[str]:
    """Return the texts in X for a variable: of an own velocity with what changes at rest."""
    kind = smooth.variable.kind
    if not smooth.is_of_own_speed:
        return list(dict.fromkeys(of_position() if kind == 'q' else of_velocity(is_own=False)))
    texts = list(dict.fromkeys(of_velocity(is_own=True)))
    return list(dict.fromkeys([*texts, *(smoothed(t) for t in texts)]))


def law(
    smooth: SmoothForce, motion: ObservedMotion, seen: Range, text: str,
    numbers: Mapping[str, float],
) -> FoundLaw:  # fmt: skip
    """Return a text as a law of the joint of a smooth force."""
    own = 'm' if motion.tree.is_prismatic[smooth.joint] else 'rad'
    known = smooth.known_factor
    force = FORCES[own] if known is None else known.unit
    others = {p.name: p for p in known.parameters} if known else {}
    per = '1' if smooth.is_of_own_speed or known else smooth.factor_unit(motion.tree)
    plain = text.replace('X', smooth.variable.text)
    whole = _times(plain, '' if smooth.is_of_own_speed else smooth.factor)
    formula = read_formula(whole, is_law=True)
    parameters = [
        LawParameter(name, _unit(force, per, seen.unit, _power(text, name, seen, numbers)))
        if name in COEFFICIENTS else _shape(name, smooth, motion, seen, numbers)
        for name in sorted(formula.parameters, key=str.swapcase) if name not in others
    ]  # fmt: skip
    parameters += others.values()
    gate = '' if smooth.is_of_own_speed else _OF_GATE.get(smooth.gate, smooth.gate)
    words = NEAREST.get(f'{text.removesuffix(" + d")} {gate}'.strip(), NAMELESS)
    price = PER_UNUSUAL + PER_PIECE * pieces(formula)
    joint = motion.tree.moving_names[smooth.joint]
    return FoundLaw(smooth, text, formula, joint, parameters, words, price)


def _shape(
    name: str, smooth: SmoothForce, motion: ObservedMotion, seen: Range,
    numbers: Mapping[str, float],
) -> LawParameter:  # fmt: skip
    """Return a parameter that is not a coefficient, with unit, start and range."""
    if name == MEMORY:
        assert smooth.variable.memory is not None
        _, start = smooth.variable.memory
        unit = seen.unit if smooth.variable.is_of_width else 's'
        return LawParameter(name, unit, start / 3.0, start=start, high=3.0 * start)
    if name == RATIO:
        assert smooth.variable.other is not None
        weight = smooth.variable.other[2]
        low, high = sorted((weight / 3.0, 3.0 * weight))
        unit = smooth.variable.ratio_unit(motion.tree)
        return LawParameter(name, unit, low, start=weight, high=high)
    if name == SMOOTHED:
        own_speed = Variable('dq', smooth.joint, smooth.joint_name)
        seen = Range.of_variable(own_speed, motion)
    low, high, unit = seen.ends(name)
    start = numbers.get(name, smooth.width)
    return LawParameter(name, unit, low, start=start, high=high, is_known=name == 'r')


def _times(plain: str, factor: str) -> str:
    """Return a text times a factor; only a sum that no bracket holds needs one."""
    outside, depth = '', 0
    for c in plain:
        depth += (c == '(') - (c == ')')
        outside += c if not depth else ''
    whole = f'({plain})' if factor and ' + ' in outside else plain
    return f'{whole}*{factor}' if factor else whole


def _power(text: str, name: str, seen: Range, numbers: Mapping[str, float]) -> float:
    """Return the power of the variable that a coefficient is for: that by which its term scales.

    With twice the unit of the variable, every number of it is half as large, and waves twice.
    """
    formula = read_formula(text.replace('X', 'x_'), is_law=True)
    half = {'1': 1.0, seen.unit: 0.5, f'1/{seen.unit}': 2.0}
    scaled = {n: v * half[seen.ends(n)[2]] for n, v in numbers.items()}
    values = dict.fromkeys(COEFFICIENTS, 0.0) | {name: 1.0}
    for x in np.linspace(-_WIDE * seen.size, _WIDE * seen.size, 24).tolist():
        whole = formula.value(values | dict(numbers) | {'x_': x})
        part = formula.value(values | scaled | {'x_': 0.5 * x})
        if whole and part and math.isfinite(whole / part):
            return round(math.log2(abs(whole / part)), 3)
    return 0.0


def _unit(force: str, per: str, unit: str, power: float) -> str:
    """Return the unit of a factor of `x**power` times what has the unit `per`."""
    under = [f'({unit})^{power:g}'] if power not in {0.0, 1.0} else [unit] if power else []
    under += [f'({per})'] if per != '1' else []
    parts = [u if u.startswith('(') or '/' not in u else f'({u})' for u in under]
    return '/'.join([force, *parts])
