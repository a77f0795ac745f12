"""Effects that a simulated robot may have, and where they act.

The signal runs command -> drive -> joint -> sensor. An effect acts at one or more of these places
through an `Action`, and may have memory: a state that is integrated along with the motion. Signs
are those of a generalised force: `M a + h = tau + tau_x`, `tau_x` being what the effect adds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from sgp_ros.simulation.mechanism import SimulatedJoint

ParameterValue = float | str

_LINEAR_UNIT = {
    'N m': 'N', 'N m s/rad': 'N s/m', 'N m s2/rad2': 'N s2/m2', 'N m/rad': 'N/m', 'rad': 'm',
    'rad/s': 'm/s', '1/revolution': '1/m', 'kg m2': 'kg',
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What an effect can see while the robot moves.

    Attributes:
        time_s: since the start of the simulation [s].
        position: (k,) [rad or m].
        velocity: (k,) [rad/s or m/s].
        drive: (k,) forces of the motors [N m or N]; to an effect in the drive, those before it.
        state: (s,) the memory of the effect itself.
    """

    time_s: float
    position: np.ndarray
    velocity: np.ndarray
    drive: np.ndarray
    state: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Action:
    """What an effect does at each place of the chain; None where it does nothing.

    Attributes:
        joint: index of the joint it acts on.
        delay_s: the command of the joint arrives this much later [s].
        current: force that the motor's current stands for, in place of `moment.drive[joint]`
            [N m or N].
        drive: force that reaches the joint in place of `moment.drive[joint]`, behind the motor's
            current [N m or N].
        force: smooth force on the joint [N m or N].
        dry_level: magnitude of the dry friction when sliding in direction +1 or -1 [N m or N];
            at rest it holds up to this magnitude.
        inertia: added to the joint's own [kg m^2 or kg].
        sense: position and velocity that the encoder has.
        sense_velocity: velocity that is measured in place of the encoder's [rad/s or m/s].
        start: memory at the start, (s,), from position and velocity of the joint.
        state_rate: time derivative of the memory, (s,).
        substep_s: steps of the integration that it stands are at most this long [s].
    """

    joint: int
    delay_s: float = 0.0
    current: Callable[[Moment], float] | None = None
    drive: Callable[[Moment], float] | None = None
    force: Callable[[Moment], float] | None = None
    dry_level: Callable[[Moment, int], float] | None = None
    inertia: float = 0.0
    sense: Callable[[Moment], tuple[float, float]] | None = None
    sense_velocity: Callable[[Moment], float] | None = None
    start: Callable[[float, float], tuple[float, ...]] | None = None
    state_rate: Callable[[Moment], tuple[float, ...]] | None = None
    substep_s: float = math.inf


class Place(Enum):
    """What an effect may be put on."""

    JOINT = 'a joint'
    MOTOR = 'a motor'
    LAST = 'the last link of a URDF'
    BASE = 'base'
    TOOL = 'tool'


NEARER = 'nearer'
SIDES = (NEARER, 'lower', 'upper')
"""Ends of a joint's range: the one nearer to where an effect begins, or one by name."""

EVERY_MOTOR = 'all'
"""Joint of an effect that acts on every motor."""


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes:
        name: as in the text `NAME:joint=J,name=value`.
        unit: on a revolute joint.
        low: smallest value.
        choices: the only values of a parameter that is a word; empty for a number.
        unit_by_kind: other units, by the value of the parameter `kind`.
        default: value where none is given; None where one must be.
        only_kind: the parameter belongs to this value of the parameter `kind`; empty for all.
        is_joint: whether the value is the name of another joint.
    """

    name: str
    unit: str = ''
    low: float = -math.inf
    choices: tuple[str, ...] = ()
    unit_by_kind: Mapping[str, str] = field(default_factory=dict)
    default: ParameterValue | None = None
    only_kind: str = ''
    is_joint: bool = False

    def unit_on(self, joint: SimulatedJoint, kind: ParameterValue) -> str:
        """Return the unit on this joint for this value of the parameter `kind`."""
        unit = self.unit_by_kind.get(str(kind), self.unit)
        return _LINEAR_UNIT.get(unit, unit) if joint.is_prismatic else unit


SIDE = EffectParameter('side', choices=SIDES, default=NEARER)
"""At which end of its joint's range an effect sits."""


def side_of(joint: SimulatedJoint, edge: float, side: ParameterValue) -> int:
    """Return 1 for the upper end of a joint's range, -1 for the lower one.

    Args:
        joint: without limits, the nearer end is that of the sign.
        edge: where the effect begins [rad or m].
        side: one of `SIDES`.
    """
    if side != NEARER:
        return 1 if side == 'upper' else -1
    middle = 0.5 * (joint.lower + joint.upper)
    return 1 if edge >= (middle if math.isfinite(middle) else 0.0) else -1


Build = Callable[
    [tuple['SimulatedJoint', ...], int, 'Mapping[str, ParameterValue]'], tuple[Action, ...]
]
"""From all joints, the index of one and the values to what the effect does."""


@dataclass(frozen=True, slots=True, eq=False)
class EffectKind:
    """A kind of effect, before it has a joint and values.

    It either acts by what `build` returns or changes physical parameters of the mechanism.

    Attributes:
        name: as in the text.
        parameters: those without a default are required.
        build: the actions; None for an effect that changes physical parameters.
        place: what it may be put on.
        ordered: two parameters of which the first must be the smaller; empty for none.
        physical: physical parameter of the mechanism by parameter of the effect, to be added to.
        takes_all: whether it may be put on every motor at once.
    """

    name: str
    parameters: tuple[EffectParameter, ...]
    build: Build | None = None
    place: Place = Place.JOINT
    ordered: tuple[str, ...] = ()
    physical: Mapping[str, str] = field(default_factory=dict)
    takes_all: bool = False


@dataclass(frozen=True, slots=True)
class ChosenEffect:
    """An effect on a joint with its values.

    Attributes:
        name: of the kind.
        joint: name of the joint.
        parameters: values by name [unit of the parameter].
    """

    name: str
    joint: str
    parameters: Mapping[str, ParameterValue]
