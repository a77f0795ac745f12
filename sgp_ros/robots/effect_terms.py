"""Effects that a robot YAML states as parts of the robot's model.

They enter in one of three places, each by the same columns as in a diagnosis. What is a force of
the motion, `tau_x = columns @ coefficients` in `M a + h = tau + tau_x`, becomes a physics term of
the efforts, `tau = M a + h - tau_x`. What depends on the effort itself (gain, dead zone,
saturation, friction under load, torque from another joint, delay, lag) changes the recorded effort
into the one that acts, `tau + tau_x(tau)`. Tilt and payload belong to the tree.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.physics.motion import Commands
from sgp_ros.physics.place import Place
from sgp_ros.physics.term import Coefficient, Motion, Term
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_SOURCE = 'stated effect of a diagnosis'
Sign = Callable[[np.ndarray], np.ndarray]
_SETTLED = 20.0
"""Time constants after which a lag forgets: 2e-9 of a step is left."""


def changed_tree(tree: Tree, effects: Sequence[EffectAt]) -> Tree:
    """Return the tree with stated tilt of the base and payload."""
    for stated in effects:
        law = stated.effect
        if not law.is_on_tree:
            continue
        if law.is_body:
            parameters = tree.parameters.copy()
            parameters[stated.place.joint] += law.added_body(stated.shape)
            tree = replace(tree, parameters=parameters)
        else:
            size = float(np.linalg.norm(tree.gravity))
            tree = replace(tree, gravity=law.gravity(stated.shape, size))
    return tree


def effect_terms(
    tree: Tree, effects: Sequence[EffectAt], coulomb_width: float
) -> tuple[Term, ...]:
    """Return a term for each effect that is a force of the motion.

    Its coefficients have the stated values as prior means. The shape is taken as it is.

    Args:
        tree: nominal robot.
        effects: stated ones.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """
    terms = []
    for stated, names in zip(effects, coefficient_names(effects), strict=True):
        if names:
            terms.append(_term(tree, stated, names, coulomb_width))
    return tuple(terms)


def coefficient_names(effects: Sequence[EffectAt]) -> list[dict[int, str]]:
    """Return names by index of the coefficients that become terms, for each effect.

    A second effect of the same name on a joint is called `NAME_2`.
    """
    seen: Counter[tuple[str, str]] = Counter()
    found: list[dict[int, str]] = []
    for stated in effects:
        law = stated.effect
        if not law.is_online or law.is_on_tree:
            found.append({})
            continue
        seen[law.name, stated.joint] += 1
        count = seen[law.name, stated.joint]
        lead = f'{stated.joint}.{law.name}' + (f'_{count}' if count > 1 else '')
        of_effort = law.effort_columns(stated.kind)
        quantities = law.coefficient_quantities(stated.kind)
        found.append({
            i: f'{lead}.{quantities[i].name}'
            for i in range(len(stated.coefficients)) if i not in of_effort
        })  # fmt: skip
    return found


def effort_map(tree: Tree, effects: Sequence[EffectAt], coulomb_width: float) -> EffortMap | None:
    """Return how recorded efforts become those that act; None where they are the same.

    Args:
        tree: nominal robot.
        effects: stated ones.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """
    chosen = [e for e in effects if e.effect.is_online and e.effect.effort_columns(e.kind)]
    late = [each for e in chosen if e.effect.is_late for each in _on_motors(tree, e)]
    instant = in_series([e for e in chosen if not e.effect.is_late])
    measured = in_series([e for e in instant if not e.effect.is_of_command])
    chain = in_series([*late, *(e for e in instant if e.effect.stage)]) if late else ()
    return (
        EffortMap(tree, instant, measured, tuple(late), chain, coulomb_width) if chosen else None
    )


def _on_motors(tree: Tree, stated: EffectAt) -> list[EffectAt]:
    """Return an effect on every motor, joint by joint, of one that acts on all of them."""
    if stated.place.joint >= 0:
        return [stated]
    motors = np.flatnonzero(tree.is_actuated[: tree.size])
    return [replace(stated, place=Place(int(j))) for j in motors]


@dataclass(frozen=True, slots=True, eq=False)
class EffortMap:
    """From recorded efforts to those that act, `tau + tau_x(tau)`.

    Attributes:
        tree: nominal robot.
        effects: those that depend on the effort of the same time.
        measured: those of them that a measured effort does not show.
        late: those that depend on commands of the past, on one joint each.
        chain: these in series with the drives among the others.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """

    tree: Tree
    effects: tuple[EffectAt, ...]
    measured: tuple[EffectAt, ...]
    late: tuple[EffectAt, ...]
    chain: tuple[EffectAt, ...]
    coulomb_width: float

    def __call__(
        self, effort: np.ndarray, velocity: np.ndarray, *, is_measured: bool
    ) -> np.ndarray:
        """Return the efforts that act but for what comes late, (n, k) [N m or N].

        Args:
            effort: recorded, (n, k) [N m or N].
            velocity: (n, k) [rad/s or m/s].
            is_measured: of the motor's current, behind the dead zone and saturation of a drive.
        """
        still = np.zeros_like(velocity)
        motion = Motion(still, velocity, still, effort)
        acting = effort.copy()
        for stated in self.measured if is_measured else self.effects:
            columns = list(stated.effect.effort_columns(stated.kind))
            force = _forces(self.tree, stated, motion, _smooth(self.coulomb_width))[:, :, columns]
            acting += force @ stated.coefficients[columns]
        return acting

    @property
    def memory_s(self) -> float:
        """How long a command matters after the next one [s]."""
        return _SETTLED * max((float(e.shape[0]) for e in self.late), default=0.0)

    def late_effort(self, drive: Commands) -> np.ndarray:
        """Return what comes later than the commands, over what they are now, (n, k) [N m or N].

        Args:
            drive: commands of at least the last `memory_s`, with n rows wanted.
        """
        if not self.late:
            return np.zeros((1, self.tree.size))
        now = np.column_stack([drive.effort(j) for j in range(self.tree.size)])
        still = np.zeros_like(now)
        added = np.zeros_like(now)
        motion = Motion(still, still, still, now)
        now_too = (e for e in self.effects if e.effect.stage)
        for sign, effects in ((1.0, self.chain), (-1.0, now_too)):
            for stated in effects:
                force = _forces(self.tree, stated, motion, np.sign, drive) @ stated.coefficients
                added += sign * force
        return added


def rest_friction(
    tree: Tree, effects: Sequence[EffectAt], coulomb_width: float
) -> RestFriction | None:
    """Return what dry friction may do at rest; None where no stated effect holds a joint.

    Args:
        tree: nominal robot.
        effects: stated ones.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """
    chosen = tuple(e for e in effects if e.effect.is_online and e.is_holding)
    return RestFriction(tree, chosen, coulomb_width) if chosen else None


@dataclass(frozen=True, slots=True, eq=False)
class RestFriction:
    """Dry friction at rest, anything between what it is in sliding one way and the other.

    Attributes:
        tree: nominal robot.
        effects: those that hold a joint at rest.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """

    tree: Tree
    effects: tuple[EffectAt, ...]
    coulomb_width: float

    @property
    def joints(self) -> frozenset[int]:
        """Indices of the joints that they hold."""
        return frozenset(j for e in self.effects for j in e.held_joints)

    def __call__(self, motion: Motion) -> np.ndarray:
        """Return the least and the largest force beyond the one that the rows take, (2, n, k).

        The rows take the direction of motion from the velocity, made smooth over the width.
        """
        ends = np.zeros((2, *motion.position.shape))
        for stated in self.effects:
            now = _smooth(self.coulomb_width)
            taken, *sliding = (
                _forces(self.tree, stated, motion, sign) @ stated.coefficients
                for sign in (now, lambda v: -np.ones_like(v), np.ones_like)
            )
            ends += np.sort(np.array(sliding) - taken, axis=0)
        return ends


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    """The efforts of a drive without memory, so without delay and lag."""

    values: np.ndarray

    def effort(
        self, joint: int, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        assert delay == time_constant == 0.0
        u = self.values[:, joint]
        return u if characteristic is None else characteristic(u)


def _smooth(width: float) -> Sign:
    """Return the sign of a velocity, made smooth over a width [rad/s or m/s]."""
    return lambda v: np.tanh(v / width)


def _forces(
    tree: Tree, stated: EffectAt, motion: Motion, sign: Sign, drive: Commands | None = None
) -> np.ndarray:
    """Return the force per coefficient on every joint, (n, k, m).

    The rows stand alone, so what stands for the sign of a velocity is given. Without a drive the
    efforts are its commands.
    """
    n, k = motion.position.shape
    seen = ObservedMotion(
        tree, np.zeros(n), 0.0, motion.position, motion.velocity, motion.acceleration,
        motion.effort, drive or _Instant(motion.effort), sign=sign,
    )  # fmt: skip
    columns = stated.columns(seen)
    if columns.ndim == 3:
        return columns
    forces = np.zeros((n, k, columns.shape[1]))
    forces[:, stated.place.joint] = columns
    return forces


def _term(tree: Tree, stated: EffectAt, names: Mapping[int, str], coulomb_width: float) -> Term:
    def columns(motion: Motion) -> np.ndarray:
        return -_forces(tree, stated, motion, _smooth(coulomb_width))[:, :, list(names)]

    joint = stated.place.joint
    prismatic = joint >= 0 and bool(tree.is_prismatic[joint])
    quantities = stated.effect.coefficient_quantities(stated.kind)
    coefficients = tuple(
        Coefficient(
            name,
            quantities[i].unit_on(is_prismatic=prismatic),
            stated.joint if joint >= 0 else None,
            float(stated.coefficients[i]),
            float(stated.std[i]),
            quantities[i].low,
        )
        for i, name in names.items()
    )
    return Term(coefficients, columns, _SOURCE)
