"""Forces without form: a smooth function of one variable, times a factor in another.

    tau_x = f(x) g,   f a cubic spline,   g of 1, sign(v), v, |v| v, motor torque

The variables of a force are found here before any formula is tried. A named law that leaves more
than such a force, at its price, is not the law; and a formula is looked for only among those of
the variable and the factor that explain most.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.interpolate import BSpline

from sgp_ros.diagnosis.decide.everyday import LONGEST_LAG
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.unlisted.variables import DEGREE, FORCES, MEMORY, Variable
from sgp_ros.physics.catalogue import COULOMB_FRICTION
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import LawParameter, Quantity, Value
from sgp_ros.physics.place import Place, Placed

SMOOTHED, SLOWEST = 'v_s', 1e-3
"""Speed of a soft sign: its name, and its least value in parts of the greatest speed."""
PIECES, FINE = 8, 16
"""Pieces of a spline: of one to be compared at its price, and of one that follows any law."""
LEAST_PLAY, MOST_PLAY = 0.02, 0.9
"""Play that is looked for, in parts of the range that was seen."""
_LADDER = 7
"""Lags and plays that are tried first."""
GATES = ('', 'sign', 'soft', 'speed', 'square', 'effort')
"""Factors: 1, sign(v), tanh(v/v_s), v, |v| v, motor torque."""
LAW = 'law'
"""Factor that is a formula, found before."""
_NUMBERED = re.compile(r'(?<![\["])\b([xwvnpoue][0-3]|r|v_s|T|R)\b(?!["\]])')
MORE_GATES = ('ahead', 'back', 'spin', 'place')
"""Factors that are tried where these leave something: v ahead, v back, v squared, q."""
_TEXTS = {
    '': '', 'sign': 'sign({v})', 'soft': f'tanh({{v}}/{SMOOTHED})', 'speed': '{v}',
    'square': 'abs({v})*{v}', 'effort': '{u}', 'ahead': 'max({v}, 0)', 'back': 'min({v}, 0)',
    'spin': '{v}**2', 'place': '{q}',
}  # fmt: skip
UNITS = {'': '1', 'sign': '1', 'soft': '1', 'speed': '{l}/s', 'square': '{l}2/s2', 'effort': '{f}',
         'ahead': '{l}/s', 'back': '{l}/s', 'spin': '{l}2/s2', 'place': '{l}'}  # fmt: skip


@dataclass(frozen=True, eq=False)
class LawAsFactor:
    """A formula of one coefficient that was found, as the factor of another force.

    Attributes:
        law: without its coefficient, its parameters renamed; they start from their numbers.
        variable: that it is a function of.
        unit: of its coefficient.
    """

    law: FormulaLaw
    variable: Variable
    unit: str

    @classmethod
    def of(cls, law: EffectAt, variable: Variable, gate: str = '') -> LawAsFactor | None:
        """Return a law without its gate as a factor; None for one of several coefficients."""
        effect = law.effect
        assert isinstance(effect, FormulaLaw)
        text, found = effect.law.text, zip(effect.shape_names(), law.shape.tolist(), strict=True)
        if effect.linear != ('a',) or not (text.startswith('a*') and text.endswith(gate)):
            return None
        formula = read_formula(_renamed(text.removeprefix('a*').removesuffix(gate)), is_law=True)
        numbers = effect.known | dict(found)
        parameters = [
            replace(p, name=_renamed(p.name), start=numbers[p.name])
            for p in effect.quantities
            if isinstance(p, LawParameter) and _renamed(p.name) in formula.parameters
        ]
        (coefficient,) = effect.coefficient_quantities()
        return cls(FormulaLaw(formula, effect.joint, parameters), variable, coefficient.unit)

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        """Parameters, with their numbers as starts."""
        return tuple(p for p in self.law.quantities if isinstance(p, LawParameter))

    def values(
        self, motion: SeenMotion, numbers: Mapping[str, Value] = MappingProxyType({})
    ) -> np.ndarray:
        """Return it in a motion, (n,), with other numbers where some are given."""
        own = {p.name: float(numbers.get(p.name, p.start)) for p in self.parameters}
        shape = np.array([own[name] for name in self.law.shape_names()])
        return np.asarray(self.law.columns(motion, self.law.places(motion)[0], shape)[:, 0])


def _renamed(text: str) -> str:
    return _NUMBERED.sub(r'\g<1>_f', text)


class SmoothForce(Effect):
    """A force `f(x) g` on a joint.

    Args:
        joint: index of the joint.
        variable: x.
        gate: of `GATES`.
        knots: of the spline, (pieces + 7,).
        name: of the joint.
        width: speed over which the factor `sign` changes [rad/s or m/s]; 0 for a jump.
        factor_of: index and name of the joint whose motion the factor is; None for this one.
        known: law that is the factor, where the gate is `law`.
    """

    name = 'smooth_force'
    words = 'a smooth force without a name'
    has_chosen_form = True

    def __init__(
        self, joint: int, variable: Variable, gate: str, knots: np.ndarray, name: str,
        width: float = 0.0, factor_of: tuple[int, str] | None = None,
        known: LawAsFactor | None = None,
    ) -> None:  # fmt: skip
        self.joint, self.variable, self.gate, self.knots = joint, variable, gate, knots
        self.width, self.joint_name, self.is_dry = width, name, gate == 'sign'
        self.factor_of, self.known_factor = factor_of or (joint, name), known
        v, u, q = (Variable(kind, *self.factor_of).text for kind in ('dq', 'tau', 'q'))
        self.is_of_own_speed = variable == Variable('dq', joint, name) and known is None
        self.factor = _TEXTS[gate].format(v=v, u=u, q=q) if known is None else known.law.law.text
        self.is_dry = self.is_dry or (known is not None and known.law.is_dry)
        self.formula = f'tau_x = f({variable.text}){"*" if gate else ""}{self.factor}'
        count = len(knots) - DEGREE - 1
        self.linear = tuple(f'c{i}' for i in range(count))
        self.quantities = tuple(Quantity(name, 'N m') for name in self.linear)

    @property
    def key(self) -> str:
        """Its joint, number of pieces, variable with its weight, and factor."""
        weight = f'{self.variable.other[2]:.9g}' if self.variable.other else ''
        return f'{self.name} {self.joint} {len(self.linear)} {weight} {self.formula}'

    def has_form_of(self, s: EffectAt) -> bool:
        """Return whether a listed effect is one of its forms.

        A spline follows no jump at rest, so dry friction is none of a force without a factor.
        """
        is_jump = s.effect is COULOMB_FRICTION and not self.gate
        return self.gate in {'', 'sign', 'soft'} and self.variable.is_of(s) and not is_jump

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return its joint."""
        return [Place(self.joint)]

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return True: it has no sign to have."""
        return True

    def shape_names(self, kind: str = '') -> tuple[str, ...]:
        """Return the parameter of what remembers, or of a soft sign."""
        return (MEMORY,) if self.variable.memory else (SMOOTHED,) if self.gate == 'soft' else ()

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of that parameter."""
        if self.gate == 'soft':
            fastest = np.abs(motion.velocity[:, self.joint]).max(keepdims=True)
            return SLOWEST * fastest, fastest
        if self.variable.memory is None:
            return np.zeros(0), np.zeros(0)
        _, least = self.variable.memory
        lag = LONGEST_LAG * motion.step * len(motion.position)
        most = MOST_PLAY / LEAST_PLAY * least if self.variable.is_of_width else lag
        return np.array([least]), np.array([max(most, 2.0 * least)])

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return even ratios between these."""
        low, high = self.bounds(motion, place)
        return np.geomspace(low, high, _LADDER) if len(low) else np.zeros((1, 0))

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the parameter itself."""
        return np.abs(shape)

    def at(self, shape: np.ndarray) -> SmoothForce:
        """Return the same with that parameter fixed."""
        own, width = self.variable, self.width
        if self.gate == 'soft':
            width = float(shape[0])
        elif own.memory is not None:
            own = replace(own, memory=(own.memory[0], float(shape[0])))
        return self.changed(own, self.knots, width)

    def changed(self, variable: Variable, knots: np.ndarray, width: float) -> SmoothForce:
        """Return the same with another variable, knots and width."""
        return SmoothForce(
            self.joint, variable, self.gate, knots, self.joint_name, width, self.factor_of,
            self.known_factor,
        )  # fmt: skip

    def factor_unit(self, tree: Structure) -> str:
        """Return the unit of the factor."""
        length = 'm' if tree.is_prismatic[self.factor_of[0]] else 'rad'
        return UNITS[self.gate].format(l=length, f=FORCES[length])

    def force_unit(self, tree: Structure) -> str:
        """Return the unit of f, such that with its factor it is a force."""
        if self.known_factor is not None:
            return self.known_factor.unit
        force = FORCES['m' if tree.is_prismatic[self.joint] else 'rad']
        per = self.factor_unit(tree)
        return '1' if per == force else force if per == '1' else f'{force}/({per})'

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline times the factor, (n, m)."""
        at = self.at(shape)
        return self.basis(at.variable.values(motion)) * at.factors(motion)[:, None]

    def basis(self, x: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline at x (n,), (n, m); constant beyond what was seen."""
        inside = np.clip(x, self.knots[0], self.knots[-1])
        found = BSpline.design_matrix(inside, self.knots, DEGREE)
        return np.asarray(found.toarray())

    def factors(self, motion: SeenMotion) -> np.ndarray:
        """Return the factor g, (n,)."""
        if self.known_factor is not None:
            return self.known_factor.values(motion)
        joint = self.factor_of[0]
        v = motion.velocity[:, joint]
        if self.gate in {'sign', 'soft'} and self.width > 0.0:
            return np.tanh(v / self.width)
        if self.gate == 'sign':
            return np.asarray(motion.direction[:, joint])
        if self.gate == 'effort':
            return np.asarray(motion.effort[:, joint])
        return np.asarray({
            '': np.ones(len(v)), 'speed': v, 'square': np.abs(v) * v, 'ahead': np.maximum(v, 0.0),
            'back': np.minimum(v, 0.0), 'spin': v**2, 'place': motion.position[:, joint],
        }[self.gate])  # fmt: skip


def smooth_of(model: Model, joint: int) -> tuple[EffectAt, SmoothForce]:
    """Return the smooth force of a model at a joint, placed and as it is."""
    return next(
        (s, s.effect.at(s.shape)) for s in model.effects
        if s.place.joint == joint and isinstance(s.effect, SmoothForce)
    )  # fmt: skip


def smooth_at_bound(model: Model, joint: int) -> bool:
    """Return whether a memory is at either bound of its search."""
    placed, _ = smooth_of(model, joint)
    low, high = placed.effect.bounds(model.frame.equations.motion, placed.place)
    has_memory = placed.effect.shape_names() == (MEMORY,)
    return bool(has_memory and ((placed.shape < 1.02 * low) | (placed.shape > 0.98 * high)).any())


def unlike(smooth: list[Model], joint: int) -> list[Model]:
    """Return the models that are not followed by the same formulas as a better one."""
    found: dict[object, Model] = {}
    for model in smooth:
        placed, force = smooth_of(model, joint)
        gate = '' if force.is_of_own_speed else force.gate
        key = force.variable, gate and force.factor, model.key - {placed.key}, model.is_free
        found.setdefault(key, model)
    return list(found.values())


def beside_each(smooth: list[Model], joint: int) -> list[tuple[Model, SmoothForce]]:
    """Return the best model beside each choice of other effects; they come best first.

    One with a force of the joint's own speed, and one with another force.
    """
    found: dict[object, tuple[Model, SmoothForce]] = {}
    for model in smooth:
        placed, force = smooth_of(model, joint)
        beside = model.key - {placed.key}, force.is_of_own_speed
        found.setdefault(beside, (model, force))
    return list(found.values())
