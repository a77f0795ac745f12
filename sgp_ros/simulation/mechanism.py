"""Interface of a robot to the simulation: an equation of motion with physical parameters.

`M(q) a = force(q, v) + drive(command, v) + effects`, where all but M and a are generalised forces
on the joints. A mechanism is a frozen dataclass whose fields are its physical parameters, so that
a parameter can be replaced by name (a viscosity by 0 removes that friction).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt


@dataclass(frozen=True, slots=True)
class SimulatedJoint:
    """A joint of a simulated robot.

    Attributes:
        name: as in the recording.
        is_prismatic: [m] and [N] in place of [rad] and [N m].
        is_continuous: the position counts turns; effects that depend on it see [-pi, pi].
        lower: least position [rad or m].
        upper: greatest position [rad or m].
        effort: greatest force of the motor [N m or N].
    """

    name: str
    is_prismatic: bool = False
    is_continuous: bool = False
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf

    @property
    def turn(self) -> float:
        """Angle per unit of position in effects that are periodic: 1, or 2 pi per metre."""
        return 2.0 * math.pi if self.is_prismatic else 1.0


@dataclass(frozen=True, slots=True)
class TrueCoefficient:
    """One coefficient of the equation of motion, in the form in which it is identified.

    Attributes:
        name: as the robot that is identified names it.
        value: [unit].
        unit: SI.
    """

    name: str
    value: float
    unit: str


class Mechanism(Protocol):
    """Equation of motion of k joints driven by m commands."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def dynamics(
        self, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return inverse mass matrix and forces of gravity, inertia and viscosity.

        The first is (k, k) [1/(kg m^2) or 1/kg], the second (k,) [N m or N].
        """

    @property
    def hidden(self) -> tuple[float, ...]:
        """Where coordinates rest that follow the k joints and that no encoder shows."""

    def drive(self, command: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the forces of the motors under `command` (m,), (k,) [N m or N]."""

    def built_in(self) -> tuple[EffectAt, ...]:
        """Return the effects that belong to the robot itself, such as its dry friction."""

    def coefficients(self) -> tuple[TrueCoefficient, ...]:
        """Return the coefficients that an identification should find."""


def quantity(default: float, unit: str, description: str, *, is_positive: bool = False) -> float:
    """Declare a physical parameter of a mechanism.

    Args:
        default: value unless it is replaced [unit].
        unit: SI.
        description: what it is.
        is_positive: whether 0 and negative values are refused.
    """
    metadata = {'unit': unit, 'description': description, 'is_positive': is_positive}
    declared: float = field(default=default, metadata=metadata)
    return declared


def physical_parameters(mechanism: Mechanism) -> dict[str, dict[str, float | str]]:
    """Return value, unit and description of each physical parameter by name."""
    return {
        f.name: {
            'value': float(getattr(mechanism, f.name)),
            'unit': f.metadata['unit'],
            'description': f.metadata['description'],
        }
        for f in fields(mechanism)
        if f.metadata
    }


def with_physical(mechanism: Mechanism, changes: Mapping[str, float]) -> Mechanism:
    """Return the mechanism with some physical parameters replaced.

    Raises:
        ConfigError: unknown names, or values that are not finite or not positive where they must.
    """
    known = {f.name: f for f in fields(mechanism) if f.metadata}
    problems = [f'no physical parameter {name!r}' for name in changes if name not in known]
    for name, value in changes.items():
        if not math.isfinite(value):
            problems.append(f'{name} = {value} is not finite')
        elif name in known and known[name].metadata['is_positive'] and value <= 0.0:
            problems.append(f'{name} = {value:g} is not positive')
    if problems:
        listed = ', '.join(f'{name} [{f.metadata["unit"]}]' for name, f in known.items())
        raise ConfigError(' | '.join(problems), f'finite values of some of {listed}')
    return replace(mechanism, **changes)
