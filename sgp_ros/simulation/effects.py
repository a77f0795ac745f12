"""Effects that a simulated robot may have, and where they act.

The signal runs command -> drive -> joint -> sensor. An effect acts at one or more of these places
through an `Action`, and may have memory: a state that is integrated along with the motion. Signs
are those of a generalised force: `M a + h = tau + tau_x`, `tau_x` being what the effect adds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np

    from sgp_ros.simulation.mechanism import SimulatedJoint

ParameterValue = float | str

_LINEAR_UNIT = {
    'N m': 'N', 'N m s/rad': 'N s/m', 'rad': 'm', 'rad/s': 'm/s', '1/revolution': '1/m'
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
        drive: force that leaves the motor in place of `moment.drive[joint]` [N m or N].
        force: smooth force on the joint [N m or N].
        dry_level: magnitude of the dry friction when sliding in direction +1 or -1 [N m or N];
            at rest it holds up to this magnitude.
        sense: position and velocity that the sensor sees.
        initial_state: (s,) memory at the start.
        state_rate: time derivative of the memory, (s,).
    """

    joint: int
    delay_s: float = 0.0
    drive: Callable[[Moment], float] | None = None
    force: Callable[[Moment], float] | None = None
    dry_level: Callable[[Moment, int], float] | None = None
    sense: Callable[[Moment], tuple[float, float]] | None = None
    initial_state: tuple[float, ...] = ()
    state_rate: Callable[[Moment], tuple[float, ...]] | None = None


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes:
        name: as in the text `NAME:joint=J,name=value`.
        unit: on a revolute joint.
        low: smallest value.
        choices: the only values of a parameter that is a word; empty for a number.
        unit_by_kind: other units, by the value of the parameter `kind`.
    """

    name: str
    unit: str = ''
    low: float = -math.inf
    choices: tuple[str, ...] = ()
    unit_by_kind: Mapping[str, str] = field(default_factory=dict)

    def unit_on(self, joint: SimulatedJoint, kind: ParameterValue) -> str:
        """Return the unit on this joint for this value of the parameter `kind`."""
        unit = self.unit_by_kind.get(str(kind), self.unit)
        return _LINEAR_UNIT.get(unit, unit) if joint.is_prismatic else unit


@dataclass(frozen=True, slots=True, eq=False)
class EffectKind:
    """A kind of effect, before it has a joint and values.

    Attributes:
        name: as in the text.
        parameters: all of them are required.
        build: from joint index, joint and values to the action.
        needs_motor: whether the joint must have a command.
        ordered: two parameters of which the first must be the smaller; empty for none.
    """

    name: str
    parameters: tuple[EffectParameter, ...]
    build: Callable[[int, SimulatedJoint, Mapping[str, ParameterValue]], Action]
    needs_motor: bool = False
    ordered: tuple[str, ...] = ()


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
