"""Formulas that a smooth force may have, in the order of their length.

A formula is a shape in the variable of the smooth force, times its factor:

    tau_x[elbow] = (a*tanh((q[elbow] - x0)/w) + b)*sign(dq[elbow])

Factors are found as coefficients, and places and widths by a search within the range that was
seen. Every formula is a law as a user could write it, with units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.criteria import PER_UNUSUAL
from sgp_ros.diagnosis.unlisted.shapes import UNITS, SmoothForce
from sgp_ros.physics.formula import Formula, read_formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.parts import LawParameter
from sgp_ros.robots.observed_motion import ObservedMotion

PER_PIECE = 0.5
"""What each number, name and operation of a formula takes [nats]."""
_ANY = ('a', 'b', 'c')
"""Parameters that are factors."""
OF_POSITION = (
    'a*X', 'a*X**2', 'a*X**3',
    'a*(X - x0)**2', 'a*(X - x0)**3', 'a*abs(X - x0)*(X - x0)',
    'a*sin(n*X) + b*cos(n*X)', 'a*sin(m*X) + b*cos(m*X)',
    'a*tanh((X - x0)/w)', 'a*exp(X/w1)', 'a*exp(-X/w1)',
    'a*max(X - x0, 0)', 'a*max(x0 - X, 0)', 'a*max(X - x0, 0)**2', 'a*max(x0 - X, 0)**2',
    'a*exp(-((X - x0)/w)**2)', 'a/(1 + ((X - x0)/w)**2)',
    'a*X + b*(X - x0)**3', 'a*(abs(X - x0)/r)**p*sign(X - x0)',
)  # fmt: skip
"""Shapes in a position X."""
OF_VELOCITY = (
    'a*X', 'a*X**2', 'a*abs(X)*X', 'a*X**3',
    'a*sqrt(abs(X))*sign(X)', 'a*tanh(X/v0)', 'a*X/(1 + (X/v0)**2)', 'a*X/(1 + abs(X)/v0)',
    'a*exp(-abs(X)/v0)*sign(X)', 'a*max(X, 0)', 'a*min(X, 0)', 'a*max(abs(X) - v0, 0)*sign(X)',
    'a*X + b*X**3', 'a*X + b*abs(X)*X', 'a*X + b*tanh(X/v0)', 'a*(abs(X)/r)**p*sign(X)',
)  # fmt: skip
"""Shapes in a velocity X."""
NAMELESS = 'a law found from the data'
NEAREST = {
    'a*X/(1 + (X/v0)**2)': 'an eddy-current brake',
    'a*abs(X)*X': 'quadratic drag',
    'a*X**3': 'a cubic law',
    'a*sqrt(abs(X))*sign(X)': 'drag with the root of the speed',
    'a*X**2': 'a square law with one direction, such as wind',
    'a*tanh(X/v0)': 'friction that is smooth at rest',
    'a*max(X, 0)': 'a one-way damper',
    'a*min(X, 0)': 'a one-way damper',
    'a*X + b*(X - x0)**3': 'a hardening or softening spring',
    'a*(X - x0)**3': 'a hardening spring',
    'a*tanh((X - x0)/w)': 'a spring that saturates',
    'a*exp(X/w1)': 'a spring that stiffens exponentially',
    'a*exp(-X/w1)': 'a spring that stiffens exponentially',
    'a*max(X - x0, 0)': 'a spring on one side',
    'a*max(x0 - X, 0)': 'a spring on one side',
    'a*max(X - x0, 0)**2': 'a soft contact',
    'a*max(x0 - X, 0)**2': 'a soft contact',
    'a*exp(-((X - x0)/w)**2) sign': 'friction at a place',
    'a*X speed': 'damping of a place',
    'a*sin(n*X) + b*cos(n*X)': 'a slow wave, such as a load on an arm or a magnet',
}
"""Shape and factor to the nearest known physics."""
_WAVES = (0.15, 1.6, 4.5)
"""Periods of a sine within the range that was seen: least of slow ones, of others, greatest."""
_NARROWEST, _WIDEST = 0.03, 3.0
"""Widths in parts of the range that was seen."""


@dataclass(frozen=True, slots=True)
class _Range:
    """What was seen of a variable."""

    low: float
    high: float
    unit: str

    @property
    def span(self) -> float:
        return self.high - self.low

    @property
    def size(self) -> float:
        return max(abs(self.low), abs(self.high))


class FoundLaw(FormulaLaw):
    """A formula in place of a smooth force."""

    def __init__(
        self, smooth: SmoothForce, formula: Formula, joint: str,
        parameters: Sequence[LawParameter], words: str, price: float,
    ) -> None:  # fmt: skip
        super().__init__(formula, joint, parameters, words, is_open=True, price=price)
        self.smooth = smooth


def formulas(smooth: SmoothForce, motion: ObservedMotion) -> Iterator[FoundLaw]:
    """Yield the formulas with the variable and the factor of a smooth force."""
    x = smooth.variable.values(motion)
    prismatic = motion.tree.is_prismatic
    length = 'm' if prismatic[smooth.variable.index] else 'rad'
    own = 'm' if prismatic[smooth.joint] else 'rad'
    seen = _Range(float(x.min()), float(x.max()),
                  length if smooth.variable.kind == 'q' else f'{length}/s')  # fmt: skip
    force = 'N' if own == 'm' else 'N m'
    per = UNITS[smooth.gate].format(l=own, f=force)
    speed = motion.velocity[:, smooth.joint]
    own_speed = _Range(float(speed.min()), float(speed.max()), f'{own}/s')
    joint = motion.tree.moving_names[smooth.joint]
    for text, shape in _texts(smooth):
        formula = read_formula(text, is_law=True)
        parameters = [
            _parameter(name, shape, own_speed if name == 'v1' else seen, force, per)
            for name in sorted(formula.parameters)
        ]
        size = formula.folded(lambda _node: 1.0, lambda _node, parts: 1.0 + sum(parts))
        words = NEAREST.get(f'{shape} {smooth.gate}'.strip(), NAMELESS)
        price = PER_UNUSUAL + PER_PIECE * size
        yield FoundLaw(smooth, formula, joint, parameters, words, price)


def _texts(smooth: SmoothForce) -> Iterator[tuple[str, str]]:
    """Yield formulas with their shapes in X.

    With a factor each shape also comes with a constant, for friction that a place only changes,
    and the sign of a velocity comes with a smooth form.
    """
    x = smooth.variable
    factors = [smooth.factor]
    if smooth.gate == 'sign':
        factors.append(f'tanh({smooth.factor[5:-1]}/v1)')
    is_friction = smooth.gate == 'sign' and x.kind == 'dq' and x.index == smooth.joint
    for shape in OF_POSITION if x.kind == 'q' else OF_VELOCITY:
        plain = shape.replace('X', x.text)
        if not smooth.factor:
            yield plain, shape
            if 'exp(' in shape or 'max(' in shape:  # others have a zero where they need one
                yield f'{plain} + d', shape
            continue
        for factor in factors:
            yield f'({plain} + d)*{factor}', shape
            if not is_friction:
                alone = f'({plain})' if ' + b' in shape else plain
                yield f'{alone}*{factor}', shape


def _parameter(name: str, shape: str, seen: _Range, force: str, per: str) -> LawParameter:
    """Return a parameter with its unit, start and range."""
    if name in {*_ANY, 'd'}:
        power = 0.0 if name == 'd' else _power(shape, name)
        return LawParameter(name, _unit(force, per, seen.unit, power))
    middle, span, size = 0.5 * (seen.low + seen.high), seen.span, seen.size
    turn = 2.0 * np.pi / span
    start, low, high, unit = {
        'x0': (middle, seen.low - 0.25 * span, seen.high + 0.25 * span, seen.unit),
        'w': (0.3 * span, _NARROWEST * span, _WIDEST * span, seen.unit),
        'w1': (span, _NARROWEST * span, _WIDEST * span, seen.unit),
        'v1': (0.05 * size, 1e-3 * size, size, seen.unit),
        'v0': (0.1 * size, 1e-3 * size, _WIDEST * size, seen.unit),
        'n': (0.6 * turn, _WAVES[0] * turn, _WAVES[1] * turn, f'1/{seen.unit}'),
        'm': (2.5 * turn, _WAVES[1] * turn, _WAVES[2] * turn, f'1/{seen.unit}'),
        'r': (size, 0.0, np.inf, seen.unit),
        'p': (1.5, 0.05, 6.0, '1'),
    }[name]
    return LawParameter(name, unit, low, start=start, high=high, is_known=name == 'r')


def _power(shape: str, name: str) -> float:
    """Return the power of the variable that a factor is for."""
    (part,) = [p for p in shape.split(' + ') if p.startswith((f'{name}*', f'{name}/'))]
    for text, power in (
        ('tanh', 0.0), ('exp', 0.0), ('sin', 0.0), ('cos', 0.0), ('1 + ((', 0.0), ('/r)', 0.0),
        ('sqrt', 0.5), ('**3', 3.0), ('**2', 2.0 if '/v0)**2' not in part else 1.0),
        ('abs(X)*X', 2.0), ('abs(X - x0)*(', 2.0),
    ):  # fmt: skip
        if text in part:
            return power
    return 1.0


def _unit(force: str, per: str, unit: str, power: float) -> str:
    """Return the unit of a factor of `x**power` times what has the unit `per`."""
    under = [f'({unit})^{power:g}'] if power not in {0.0, 1.0} else [unit] if power else []
    under += [f'({per})'] if per != '1' else []
    parts = [u if u.startswith('(') or '/' not in u else f'({u})' for u in under]
    return '/'.join([force, *parts])
