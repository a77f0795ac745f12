"""Forces without form: a smooth function of one variable, times a factor in another.

    tau_x = f(x) g,   f a cubic spline,   g of 1, sign(v), v, |v| v, motor torque

The variables of a force are found here before any formula is tried. A named law that leaves more
than such a force, at its price, is not the law; and a formula is looked for only among those of
the variable and the factor that explain most.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from sgp_ros.diagnosis.decide.everyday import LONGEST_LAG
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import remembered
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import Place, Placed, Quantity
from sgp_ros.robots.observed_motion import ObservedMotion

SMOOTHED, SLOWEST = 'v_s', 1e-3
"""Speed of a soft sign: its name, and its least value in parts of the greatest speed."""
PIECES, FINE = 8, 16
"""Pieces of a spline: of one to be compared at its price, and of one that follows any law."""
_DEGREE = 3
MEMORY = 'T'
"""Parameter of what remembers."""
LEAST_PLAY, MOST_PLAY = 0.02, 0.9
"""Play that is looked for, in parts of the range that was seen."""
_LADDER = 7
"""Lags and plays that are tried first."""
RATIO = 'R'
"""Parameter of a sum of two joints."""
GATES = ('', 'sign', 'soft', 'speed', 'square', 'effort')
"""Factors: 1, sign(v), tanh(v/v_s), v, |v| v, motor torque."""
MORE_GATES = ('ahead', 'back', 'spin', 'place')
"""Factors that are tried where these leave something: v ahead, v back, v squared, q."""
_TEXTS = {
    '': '', 'sign': 'sign({v})', 'soft': f'tanh({{v}}/{SMOOTHED})', 'speed': '{v}',
    'square': 'abs({v})*{v}', 'effort': '{u}', 'ahead': 'max({v}, 0)', 'back': 'min({v}, 0)',
    'spin': '{v}**2', 'place': '{q}',
}  # fmt: skip
UNITS = {'': '1', 'sign': '1', 'soft': '1', 'speed': '{l}/s', 'square': '{l}2/s2', 'effort': '{f}',
         'ahead': '{l}/s', 'back': '{l}/s', 'spin': '{l}2/s2', 'place': '{l}'}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Variable:
    """Variable of a force: `q` or `dq` of a joint, of two joints, or an earlier value of it.

    Attributes:
        kind: `q` or `dq`.
        index, joint: of the joint, and its name.
        other: index, name and weight of a joint that is added; None for none.
        memory: `lag` or `play` with its number [s, or unit of q]; None for none.
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
            return f'{self.memory[0]}({self._signal(self.joint)}, {MEMORY})'
        if self.other is None:
            return self._signal(self.joint)
        _, name, weight = self.other
        sign, times = ('+', f'{RATIO}*') if self.is_weighted else ('+' if weight > 0 else '-', '')
        return f'({self._signal(self.joint)} {sign} {times}{self._signal(name)})'

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
        return length if self.kind == 'q' else f'{length}/s'

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
        return np.concatenate([np.full(_DEGREE, inner[0]), inner, np.full(_DEGREE, inner[-1])])

    def is_of(self, s: EffectAt) -> bool:
        """Return whether an effect is a function of it, if it is of the effect's own joint."""
        over = {'q': 'position', 'dq': 'velocity'}[self.kind]
        return self.is_plain and s.place.joint == self.index and s.effect.drawn_over == over

    @property
    def words(self) -> str:
        """As it stands in a sentence."""
        what = 'position' if self.kind == 'q' else 'velocity'
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
        of = motion.position if self.kind == 'q' else motion.velocity
        x = np.asarray(of[:, self.index])
        if self.memory:
            name, number = self.memory
            return remembered(name, motion, x, number)
        return x if self.other is None else x + self.other[2] * of[:, self.other[0]]


def force_unit(gate: str, *, is_prismatic: bool) -> str:
    """Return the unit of f on a joint, such that with its factor it is a force."""
    length, force = ('m', 'N') if is_prismatic else ('rad', 'N m')
    per = UNITS[gate].format(l=length, f=force)
    return '1' if gate == 'effort' else force if per == '1' else f'{force}/({per})'


class SmoothForce(Effect):
    """A force `f(x) g` on a joint.

    Args:
        joint: index of the joint.
        variable: x.
        gate: of `GATES`.
        knots: of the spline, (pieces + 7,).
        name: of the joint.
        width: speed over which the factor `sign` changes [rad/s or m/s]; 0 for a jump.
    """

    name = 'smooth_force'
    words = 'a smooth force without a name'
    has_chosen_form = True

    def __init__(
        self, joint: int, variable: Variable, gate: str, knots: np.ndarray, name: str,
        width: float = 0.0,
    ) -> None:  # fmt: skip
        self.joint, self.variable, self.gate, self.knots = joint, variable, gate, knots
        self.width, self.joint_name, self.is_dry = width, name, gate == 'sign'
        own = Variable('dq', joint, name)
        effort, place = (own.text.replace('dq[', f'{kind}[', 1) for kind in ('tau', 'q'))
        self.is_of_own_speed = variable == own
        self.factor = _TEXTS[gate].format(v=own.text, u=effort, q=place)
        self.formula = f'tau_x = f({variable.text}){"*" if gate else ""}{self.factor}'
        count = len(knots) - _DEGREE - 1
        self.linear = tuple(f'c{i}' for i in range(count))
        self.quantities = tuple(Quantity(name, 'N m') for name in self.linear)

    @property
    def key(self) -> str:
        """Its joint, number of pieces, variable with its weight, and factor."""
        weight = f'{self.variable.other[2]:.9g}' if self.variable.other else ''
        return f'{self.name} {self.joint} {len(self.linear)} {weight} {self.formula}'

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
        kind, least = self.variable.memory
        lag = LONGEST_LAG * motion.step * len(motion.position)
        most = lag if kind == 'lag' else MOST_PLAY / LEAST_PLAY * least
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
        return SmoothForce(self.joint, own, self.gate, self.knots, self.joint_name, width)

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline times the factor, (n, m)."""
        at = self.at(shape)
        return self.basis(at.variable.values(motion)) * at.factors(motion)[:, None]

    def basis(self, x: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline at x (n,), (n, m); constant beyond what was seen."""
        inside = np.clip(x, self.knots[0], self.knots[-1])
        found = BSpline.design_matrix(inside, self.knots, _DEGREE)
        return np.asarray(found.toarray())

    def factors(self, motion: SeenMotion) -> np.ndarray:
        """Return the factor g, (n,)."""
        v = motion.velocity[:, self.joint]
        if self.gate in {'sign', 'soft'} and self.width > 0.0:
            return np.tanh(v / self.width)
        if self.gate == 'sign':
            return np.asarray(motion.direction[:, self.joint])
        if self.gate == 'effort':
            return np.asarray(motion.effort[:, self.joint])
        return np.asarray({
            '': np.ones(len(v)), 'speed': v, 'square': np.abs(v) * v, 'ahead': np.maximum(v, 0.0),
            'back': np.minimum(v, 0.0), 'spin': v**2, 'place': motion.position[:, self.joint],
        }[self.gate])  # fmt: skip


def smooth_of(model: Model, joint: int) -> tuple[EffectAt, SmoothForce]:
    """Return the smooth force of a model at a joint, placed and as it is."""
    return next(
        (s, s.effect.at(s.shape)) for s in model.effects
        if s.place.joint == joint and isinstance(s.effect, SmoothForce)
    )  # fmt: skip


def smooth_at_bound(model: Model, joint: int, motion: ObservedMotion) -> bool:
    """Return whether a memory is at either bound of its search."""
    placed, _ = smooth_of(model, joint)
    low, high = placed.effect.bounds(motion, placed.place)
    has_memory = placed.effect.shape_names() == (MEMORY,)
    return bool(has_memory and ((placed.shape < 1.02 * low) | (placed.shape > 0.98 * high)).any())


def unlike(smooth: list[Model], joint: int) -> list[Model]:
    """Return the models that are not followed by the same formulas as a better one."""
    found: dict[object, Model] = {}
    for model in smooth:
        placed, force = smooth_of(model, joint)
        gate = '' if force.is_of_own_speed else force.gate
        key = force.variable, gate, model.key - {placed.key}, model.is_free
        found.setdefault(key, model)
    return list(found.values())


def beside_each(smooth: list[Model], joint: int) -> list[tuple[Model, SmoothForce]]:
    """Return the best model beside each choice of other effects; they come best first.

    Left out are those of the joint's own speed, whose knots are dense where friction changes.
    """
    found: dict[object, tuple[Model, SmoothForce]] = {}
    for model in smooth:
        placed, force = smooth_of(model, joint)
        if not force.is_of_own_speed:
            found.setdefault(model.key - {placed.key}, (model, force))
    return list(found.values())
