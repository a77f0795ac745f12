"""Effects that a simulated robot may have, and where they act.

The signal runs command -> drive -> joint -> sensor. An effect acts at one or more of these places
through an `Action`, and may have memory: a state that is integrated along with the motion. Signs
are those of a generalised force: `M a + h = tau + tau_x`, `tau_x` being what the effect adds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.parts import Quantity, Value
from sgp_ros.physics.place import SIDES
from sgp_ros.simulation.mechanism import Mechanism, SimulatedJoint


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """State that an effect can see while the robot moves.

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
    """Action of an effect at each place of the chain; None where it does nothing.

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
        geared: joint and ratio r of a motor that turns with `v + r v_joint`; the dry friction is
            along this speed then, and acts on both joints.
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
    geared: tuple[int, float] | None = None
    inertia: float = 0.0
    sense: Callable[[Moment], tuple[float, float]] | None = None
    sense_velocity: Callable[[Moment], float] | None = None
    start: Callable[[float, float], tuple[float, ...]] | None = None
    state_rate: Callable[[Moment], tuple[float, ...]] | None = None
    substep_s: float = math.inf


NEARER = 'nearer'
"""The end of a joint's range nearer to where an effect begins, unless `SIDES` names one."""

EVERY_MOTOR = 'all'
"""Joint of an effect that acts on every motor."""


@dataclass(frozen=True, slots=True)
class EffectParameter(Quantity):
    """A parameter of an effect, as the text `NAME:joint=J,name=value` states it.

    Attributes:
        choices: the only values of a parameter that is a word; empty for a number.
        default: value where none is given; None where one must be.
        is_joint: whether the value is the name of another joint.
    """

    unit: str = ''
    choices: tuple[str, ...] = ()
    default: Value | None = None
    is_joint: bool = False


def side_of(joint: SimulatedJoint, edge: float, side: Value) -> int:
    """Return 1 for the upper end of a joint's range, -1 for the lower one.

    Args:
        joint: without limits, the nearer end is that of the sign.
        edge: where the effect begins [rad or m].
        side: `NEARER` or one of `SIDES`.
    """
    if side != NEARER:
        return 1 if side == 'upper' else -1
    middle = 0.5 * (joint.lower + joint.upper)
    return 1 if edge >= (middle if math.isfinite(middle) else 0.0) else -1


def source_of(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value], effect: str
) -> int:
    """Return the index of another joint that the effect comes from.

    Raises:
        ConfigError: there is none of this name, or it is the joint itself.
    """
    names = [description.name for description in joints]
    if values['source_joint'] not in names or values['source_joint'] == names[joint]:
        raise ConfigError(
            f'{effect} of {names[joint]!r} with {values["source_joint"]!r}',
            f'another one of {names}',
        )
    return names.index(str(values['source_joint']))


Build = Callable[[tuple['SimulatedJoint', ...], int, 'Mapping[str, Value]'], tuple[Action, ...]]
"""From all joints, the index of one and the values to what the effect does."""


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """Law by which the simulation realises an effect of the catalogue.

    It either acts by what `build` returns or changes the mechanism.

    Attributes:
        build: the actions; None for an effect that changes physical parameters.
        physical: physical parameter of the mechanism by parameter of the effect, to be added to.
        changed: from mechanism and values to a mechanism with coordinates that no controller
            knows of; None for no change.
        ordered: two parameters of which the first must be the smaller; empty for none.
        own: parameters that only the simulation has.
    """

    build: Build | None = None
    physical: Mapping[str, str] = field(default_factory=dict)
    changed: Callable[[Mechanism, Mapping[str, Value]], Mechanism] | None = None
    ordered: tuple[str, ...] = ()
    own: tuple[EffectParameter, ...] = ()

    def parameters(self, effect: Effect) -> tuple[EffectParameter, ...]:
        """Return the parameters of an effect and those of its law; without default, required."""
        words = [EffectParameter('source_joint', is_joint=True)] if effect.has_source else []
        words += [EffectParameter(effect.kind_word, choices=effect.kinds)] if effect.kinds else []
        ends = (NEARER, *SIDES)
        side = [EffectParameter('side', choices=ends, default=NEARER)] if effect.edge else []
        own = {p.name for p in self.own}
        numbers = (
            EffectParameter(q.name, q.unit, q.low, kinds=q.kinds)
            for q in effect.quantities
            if q.name not in own
        )
        return *words, *numbers, *side, *self.own
