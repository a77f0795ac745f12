"""Forces without form: a smooth function of one variable, times a factor in another.

    tau_x = f(x) g,   f a cubic spline,   g of 1, sign(v), v, |v| v, motor torque

What depends on what is seen here before any formula is tried. A named law that leaves more than
such a force, at its price, is not the law; and a formula is looked for only among those of the
variable and the factor that explain most.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Place, Placed, Quantity
from sgp_ros.robots.observed_motion import ObservedMotion

PIECES, FINE = 8, 16
"""Pieces of a spline: of one to be compared at its price, and of one that follows any law."""
_DEGREE = 3
GATES = ('', 'sign', 'speed', 'square', 'effort')
"""Factors: 1, sign(v), v, |v| v, motor torque."""
_TEXTS = {
    '': '', 'sign': 'sign({v})', 'speed': '{v}', 'square': 'abs({v})*{v}', 'effort': '{u}',
}  # fmt: skip
UNITS = {'': '1', 'sign': '1', 'speed': '{l}/s', 'square': '{l}2/s2', 'effort': '{f}'}


@dataclass(frozen=True, slots=True)
class Variable:
    """What a force may be a function of: `q` or `dq` of a joint, by index and name."""

    kind: str
    index: int
    joint: str

    @property
    def text(self) -> str:
        """As it stands in a formula."""
        name = self.joint if self.joint.isidentifier() else f'"{self.joint}"'
        return f'{self.kind}[{name}]'

    def knots(self, motion: SeenMotion, pieces: int) -> np.ndarray:
        """Return the knots of a spline over it, (pieces + 7,).

        Half way from even ones to quantiles: the ends of a range are seldom seen, and tell most.
        Of velocities, denser towards rest, where friction changes.
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
        return s.place.joint == self.index and s.effect.drawn_over == over

    @property
    def words(self) -> str:
        """As it stands in a sentence."""
        return f'{"position" if self.kind == "q" else "velocity"} of {self.joint}'

    def values(self, motion: SeenMotion) -> np.ndarray:
        """Return it in a motion, (n,)."""
        of = motion.position if self.kind == 'q' else motion.velocity
        return np.asarray(of[:, self.index])


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

    def __init__(
        self, joint: int, variable: Variable, gate: str, knots: np.ndarray, name: str,
        width: float = 0.0,
    ) -> None:  # fmt: skip
        self.joint, self.variable, self.gate, self.knots = joint, variable, gate, knots
        self.width = width
        own = Variable('dq', joint, name)
        effort = own.text.replace('dq[', 'tau[', 1)
        self.factor = _TEXTS[gate].format(v=own.text, u=effort)
        self.formula = f'tau_x = f({variable.text}){"*" if gate else ""}{self.factor}'
        count = len(knots) - _DEGREE - 1
        self.linear = tuple(f'c{i}' for i in range(count))
        self.quantities = tuple(Quantity(name, 'N m') for name in self.linear)

    @property
    def key(self) -> str:
        """Its joint, variable and factor."""
        return f'{self.name} {self.joint} {self.formula}'

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return its joint."""
        return [Place(self.joint)]

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return True: it has no sign to have."""
        return True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline times the factor, (n, m)."""
        return self.basis(self.variable.values(motion)) * self.factors(motion)[:, None]

    def basis(self, x: np.ndarray) -> np.ndarray:
        """Return the pieces of the spline at x (n,), (n, m); constant beyond what was seen."""
        inside = np.clip(x, self.knots[0], self.knots[-1])
        found = BSpline.design_matrix(inside, self.knots, _DEGREE)
        return np.asarray(found.toarray())

    def factors(self, motion: SeenMotion) -> np.ndarray:
        """Return the factor g, (n,)."""
        v = motion.velocity[:, self.joint]
        if self.gate == 'sign' and self.width > 0.0:
            return np.tanh(v / self.width)
        if self.gate == 'sign':
            return np.asarray(motion.direction[:, self.joint])
        if self.gate == 'effort':
            return np.asarray(motion.effort[:, self.joint])
        return np.asarray({'': np.ones(len(v)), 'speed': v, 'square': np.abs(v) * v}[self.gate])


def smooth_forces(motion: ObservedMotion, joint: int) -> Iterator[SmoothForce]:
    """Yield the smooth forces that may act on a joint.

    Of a velocity by itself only odd and even parts with a jump at rest: `f(|v|) sign(v)` is the
    factor `sign`. Where the effort was measured nothing is explained by it.
    """
    names = motion.tree.moving_names
    for i in motion.moving_joints:
        for kind in ('q', 'dq'):
            variable = Variable(kind, i, names[i])
            knots = variable.knots(motion, PIECES)
            for gate in GATES:
                if gate == 'effort' and not motion.is_commanded[joint]:
                    continue
                if kind == 'dq' and i == joint and gate not in {'', 'sign'}:
                    continue  # a function of v with a factor of v is a function of v
                yield SmoothForce(joint, variable, gate, knots, names[joint])
