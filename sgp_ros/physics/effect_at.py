"""Effects at places of a robot, with their numbers: fitted, stated in a file, or simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sgp_ros.physics.actuation import Characteristic, Drive
from sgp_ros.physics.effect import EMPTY, Effect, Numbers
from sgp_ros.physics.in_series import behind
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import Quantity, Value
from sgp_ros.physics.place import NOWHERE, PLACES, Place, place_of_word

_AT_BOUND = 1e-6
"""Distance from a bound, in scales of the search, within which a number is at it."""


@dataclass(frozen=True, slots=True, eq=False)
class EffectAt:
    """An effect at a place of a robot, with its numbers.

    In equations these are shape and coefficients; in files and reports they are `parameters` by
    name, and the place is the name of a joint. `stated` gives the first from the second.

    Attributes:
        effect: the law.
        place: where it acts.
        shape: (s,).
        coefficients: (m,); empty while only the shape is chosen.
        joint: name of the place, as stated; empty where it was not stated.
        parameters: stated numbers (SI) and words by name; empty where they were not stated.
        std: (m,) standard deviations of the coefficients; infinite where not known.
        before: drives that stand before it on its motor, see `in_series`.
    """

    effect: Effect
    place: Place
    shape: np.ndarray = field(default_factory=lambda: EMPTY)
    coefficients: np.ndarray = field(default_factory=lambda: EMPTY)
    joint: str = ''
    parameters: Mapping[str, Value] = field(default_factory=dict)
    std: np.ndarray = field(default_factory=lambda: EMPTY)
    before: tuple[EffectAt, ...] = ()

    @classmethod
    def stated(
        cls, effect: Effect, joint: str, parameters: Mapping[str, Value], tree: Structure,
        std: Numbers | None = None,
    ) -> EffectAt:  # fmt: skip
        """Return the effect with stated parameters on a robot.

        Args:
            effect: the law.
            joint: name of a joint that moves on its own, or a word for another place.
            parameters: the stated numbers, and `kind`, `source_joint`, `side` where there are.
            tree: the robot.
            std: standard deviations of the numbers that have one.

        Raises:
            ValueError: a joint that does not move on its own.
        """
        words = {'kind' if k == effect.kind_word else k: x
                 for k, x in parameters.items() if isinstance(x, str)}  # fmt: skip
        numbers = {k: x for k, x in parameters.items() if not isinstance(x, str)}
        place = Place.of(effect.site, effect.edge, joint, words, numbers, tree)
        if not effect.is_force:
            return cls(effect, place, joint=joint, parameters=parameters)
        shape, coefficients = effect.model(numbers, place.kind)
        spread = effect.coefficient_std(numbers, std or {}, place.kind)
        return cls(effect, place, shape, coefficients, joint, parameters, spread)

    @classmethod
    def wanted(cls, effect: Effect, joint: str, parameters: Mapping[str, Value]) -> EffectAt:
        """Return the effect with stated parameters, of a robot that is not yet known.

        Whoever knows the robot finds the place by the name of the joint.
        """
        word = place_of_word(joint, effect.site)
        at = Place(NOWHERE if word is None else word)
        return cls(effect, at, joint=joint, parameters=parameters)

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.effect.name

    @property
    def key(self) -> tuple[str, Place]:
        """Law and place."""
        return self.effect.key, self.place

    @property
    def is_further_wave(self) -> bool:
        """Whether it is a further wave of a law at its place, and not a second motor."""
        return bool(self.place.number) and not self.effect.has_source

    @property
    def kind(self) -> str:
        """Its kind, where the law comes in kinds."""
        return self.place.kind

    @property
    def numbers(self) -> dict[str, float]:
        """The stated parameters that are numbers."""
        return {k: x for k, x in self.parameters.items() if not isinstance(x, str)}

    @property
    def is_holding(self) -> bool:
        """Whether it can hold a joint at rest."""
        return bool(self.held_joints)

    @property
    def held_joints(self) -> frozenset[int]:
        """Indices of the joints that it can hold at rest."""
        return self.effect.held_joints(self.place)

    @property
    def is_complete(self) -> bool:
        """Whether the stated numbers say what it does; of backlash they do not say enough."""
        return bool(np.isfinite(self.shape).all() and np.isfinite(self.coefficients).all())

    def stands_for(self, plain: EffectAt) -> bool:
        """Return whether it takes the place of a plain law of its joint, which it is with more.

        Dry friction of a joint that builds up has one level; a part of it that does not build up
        would be told as a second friction.
        """
        is_one = self.effect.plain == (plain.name,) and not self.effect.has_source
        return is_one and self.place.joint == plain.place.joint

    def columns(self, motion: SeenMotion) -> np.ndarray:
        """Return the force per coefficient, (n, m) on the joint of the place or (n, k, m)."""
        seen = behind(motion, self.place.joint, self.before)
        return self.effect.columns(seen, self.place, self.shape)

    def whole(self, motion: SeenMotion) -> np.ndarray:
        """Return the force also above the bandwidth of the equations, (n,) or (n, k)."""
        return self.effect.whole(behind(motion, self.place.joint, self.before), self)

    @property
    def form(self) -> tuple[object, ...]:
        """All that its columns depend on, beside the motion."""
        return *self.key, self.shape.tobytes(), *(s.form for s in self.before)

    @property
    def delay(self) -> float:
        """Time by which it delays the command of its motor [s]."""
        return float(self.shape[0]) if self.effect.stage == 1 else 0.0

    @property
    def characteristic(self) -> Characteristic | None:
        """From commands to what it gives at the same time; None where it changes none."""
        law = self.effect
        return law.characteristic(self.shape) if isinstance(law, Drive) else None

    def force(self, motion: SeenMotion) -> np.ndarray:
        """Return what it exerts in a motion, (n, k) [N m or N]; zeros where it is not a force."""
        force = np.zeros(motion.position.shape)
        if not self.effect.is_force:
            return force
        x = self.columns(motion) @ self.coefficients
        if x.ndim == 2:
            return force + x
        force[:, self.place.joint] = x
        return force

    def report(self, motion: SeenMotion) -> dict[str, Value]:
        """Return its parameters in the words of the schema."""
        return self.effect.report(self, motion)

    def is_possible(self, motion: SeenMotion) -> bool:
        """Return whether coefficients and shape have physical signs and sizes."""
        return self.effect.is_possible(self, motion)

    def at_bounds(self, motion: SeenMotion) -> frozenset[str]:
        """Return the reported numbers that a search left at a bound: they are not estimates."""
        if not len(self.shape):
            return frozenset()
        scales = self.effect.scales(motion, self.place, self.shape)
        inward = self._inward(motion, scales)
        here = self.report(motion)
        found: set[str] = set()
        for i in np.flatnonzero(inward):
            shape = self.shape.copy()
            shape[i] += 1e-3 * inward[i] * scales[i]
            there = self.with_shape(shape).report(motion)
            found |= {name for name, x in here.items() if x != there[name]}
        return frozenset(found)

    def is_least(self, motion: SeenMotion) -> bool:
        """Return whether a search left some shape at its lower bound."""
        if not len(self.shape):
            return False
        scales = self.effect.scales(motion, self.place, self.shape)
        return bool((self._inward(motion, scales) > 0.0).any())

    def _inward(self, motion: SeenMotion, scales: np.ndarray) -> np.ndarray:
        """Return the direction away from a bound, for each shape that is at one, else 0."""
        low, high = self.effect.bounds(motion, self.place)
        inward = np.where(self.shape - low < _AT_BOUND * scales, 1.0, 0.0)
        return np.asarray(inward - np.where(high - self.shape < _AT_BOUND * scales, 1.0, 0.0))

    @property
    def sizes(self) -> tuple[Quantity, ...]:
        """The numbers that say how large it is: coefficients, else those of the first unit."""
        law, known = self.effect, self.effect.stated_quantities(self.kind)
        if law.size:
            return tuple(q for q in known if q.name == law.size)
        if law.linear:
            return tuple(q for q in known if q.name in law.linear and q.unit != 'rad')
        return tuple(q for q in known if q.unit == known[0].unit)

    def with_shape(self, shape: np.ndarray) -> EffectAt:
        """Return the same with another shape."""
        return replace(self, shape=shape)


def in_series(effects: Sequence[EffectAt], known: Sequence[EffectAt] = ()) -> tuple[EffectAt, ...]:
    """Return effects, each drive behind those that stand before it on its motor.

    Args:
        effects: at their places.
        known: those that the robot has beside them, which stand before others of their stage.
    """
    drives = [(i - len(known), s) for i, s in enumerate((*known, *effects)) if s.effect.stage]
    found = list(effects)
    placed: list[tuple[bool, EffectAt]] = []
    for i, s in sorted(drives, key=lambda x: x[1].effect.stage):
        j, stage = s.place.joint, s.effect.stage
        before = tuple(
            d for was_known, d in placed
            if j >= 0 and d.place.joint in {j, PLACES['all']}
            and (d.effect.stage < stage or (was_known and i >= 0))
        )  # fmt: skip
        chained = replace(s, before=before)
        placed.append((i < 0, chained))
        if i >= 0:
            found[i] = chained
    return tuple(found)


def one_of_each(effects: Sequence[EffectAt]) -> tuple[EffectAt, ...]:
    """Return effects without the plain ones that another one of them stands for."""
    return tuple(s for s in effects if not any(o.stands_for(s) for o in effects))
