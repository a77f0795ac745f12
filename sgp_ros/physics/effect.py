"""What a left-out effect is to the diagnosis: forces with linear coefficients and a shape.

The extra generalised force is `tau_x = columns(shape) @ coefficients` in the convention
`M a + h = tau + tau_x`. The shape holds what enters otherwise (a width, an onset, a time
constant). Effects that change what the motor or the encoder does are written as the force that
would look the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.observed_motion import ObservedMotion

Value = float | str

_LINEAR_UNITS = {
    'N m': 'N', 'N m s/rad': 'N s/m', 'N m s2/rad2': 'N s2/m2', 'rad': 'm', 'rad/s': 'm/s',
    'N m/rad': 'N/m', '1/revolution': '1/m', 'kg m2': 'kg',
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Place:
    """Where an effect is supposed to act, and in which variant.

    Attributes:
        joint: index of the joint.
        kind: such as `coulomb` or `viscous`; empty where there is but one.
        source: index of the joint it comes from; -1 where there is none.
        side: 1 or -1 for an effect at one end of the range; 0 elsewhere.
    """

    joint: int
    kind: str = ''
    source: int = -1
    side: int = 0


@dataclass(frozen=True, slots=True)
class Quantity:
    """A parameter of an effect, in the words of the schema.

    Attributes:
        name: as in `diagnosis.json`.
        unit: on a revolute joint.
    """

    name: str
    unit: str

    def unit_on(self, *, is_prismatic: bool) -> str:
        """Return the unit on a joint of this kind; a phase is an angle on any."""
        if not is_prismatic or self.name == 'phase':
            return self.unit
        return _LINEAR_UNITS.get(self.unit, self.unit)


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """An effect at a place of a robot with numbers.

    Attributes:
        motion: it was fitted on.
        place: where it acts.
        shape: (s,).
        coefficients: (m,).
    """

    motion: ObservedMotion
    place: Place
    shape: np.ndarray
    coefficients: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class SmallEffect:
    """What an effect whose shape says all is to first order in its size: where a search starts.

    Attributes:
        columns: from motion, place and one of the effect's `starts` to forces per coefficient, as
            those of an `Effect`.
        shape: from that start and coefficients (m,) to the shape of the effect itself, (s,).
    """

    columns: Callable[[ObservedMotion, Place, np.ndarray], np.ndarray]
    shape: Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """A kind of physics that a nominal model may lack.

    Attributes:
        name: as in the schema.
        quantities: the parameters that are reported.
        columns: from motion, place and shape (s,) to forces per coefficient, (n, m) on the joint
            of the place or (n, k, m) on all joints [N m or N per unit of the coefficient].
        places: where it could act on a robot, in which variants.
        starts: shapes from which a search starts, (starts, s); (1, 0) for none. Where the effect
            has a `small` one, what that needs.
        report: the values of `quantities`.
        is_possible: whether coefficients and shape have physical signs and sizes.
        formula: for people.
        is_given: the coefficient is 1: the shape alone says how large the effect is.
        is_dry: it holds a joint at rest; where there are kinds, only `coulomb` does.
        is_inertial: proportional to the acceleration.
        uses_bodies: its columns depend on the inertial parameters of the robot.
        sees_acceleration: its force depends on the acceleration.
        is_body: it changes a body; where bodies may differ, it adds nothing.
        has_memory: its force at a time depends on other times too, of the motion or the commands.
        bounds: of the shape, (s,) each.
        small: to first order in its size; None where starts are shapes.
        interval: variable and intervals of the region it is confined to; None for everywhere.
    """

    name: str
    quantities: tuple[Quantity, ...]
    columns: Callable[[ObservedMotion, Place, np.ndarray], np.ndarray]
    places: Callable[[ObservedMotion], list[Place]]
    starts: Callable[[ObservedMotion, Place], np.ndarray]
    report: Callable[[Fitted], dict[str, Value]]
    is_possible: Callable[[Fitted], bool]
    formula: str
    is_given: bool = False
    is_dry: bool = False
    is_inertial: bool = False
    uses_bodies: bool = False
    sees_acceleration: bool = False
    is_body: bool = False
    has_memory: bool = False
    bounds: Callable[[ObservedMotion, Place], tuple[np.ndarray, np.ndarray]] | None = None
    small: SmallEffect | None = None
    interval: Callable[[Fitted], tuple[str, list[list[float]]]] | None = None

    def holds(self, place: Place) -> bool:
        """Return whether it can hold the joint at rest."""
        return self.is_dry and place.kind != 'viscous'


def every_joint(motion: ObservedMotion) -> list[Place]:
    """Return a place on each joint that moves."""
    return [Place(j) for j in motion.moving_joints]


def every_motor(motion: ObservedMotion) -> list[Place]:
    """Return a place on each actuated joint that moves."""
    return [Place(j) for j in motion.moving_joints if motion.tree.is_actuated[j]]


def no_shape(_motion: ObservedMotion, _place: Place) -> np.ndarray:
    """Return the one start of an effect without shape, (1, 0)."""
    return np.zeros((1, 0))


def always(_fitted: Fitted) -> bool:
    """Say yes to any numbers."""
    return True


def is_positive(fitted: Fitted) -> bool:
    """Return whether all coefficients are positive."""
    return bool(np.all(fitted.coefficients > 0.0))


def named(*names: str) -> Callable[[Fitted], dict[str, Value]]:
    """Return a report of the coefficients under these names."""
    return lambda f: dict(zip(names, map(float, f.coefficients), strict=True))


def shaped(*names: str) -> Callable[[Fitted], dict[str, Value]]:
    """Return a report of the shape under these names."""
    return lambda f: dict(zip(names, map(float, f.shape), strict=True))
