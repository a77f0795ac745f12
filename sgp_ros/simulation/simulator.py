"""A simulated robot as a value: everything that is needed to run it, with defaults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.simulation.controllers import ControllerChoice
from sgp_ros.simulation.mechanism import Mechanism, SimulatedJoint
from sgp_ros.simulation.sensors import Sensors


@dataclass(frozen=True, slots=True, eq=False)
class Simulator:
    """A robot that can be simulated.

    Attributes:
        name: of the robot.
        joints: k of them; their order is the order of all arrays.
        command_joints: names of the m joints that are commanded.
        command_unit: unit of the commands.
        mechanism: the equation of motion with its nominal physical parameters.
        controllers: by name; the first one is the default.
        sensors: the usual ones.
        torque_noise: (k,) density of the white force on each joint [N m s^0.5 or N s^0.5]: over a
            time h its mean has the standard deviation `density / sqrt(h)`.
        rate_hz: the usual rate of sampling and control.
        same_physics: effects that only change a physical parameter, as
            `{(effect, joint): (parameter of the effect, physical parameter)}`.
        description: one sentence.
        last_joint: that of the last link, for robots whose links are known; else None.
        longest_substep_s: steps of the integration are at most this long [s]; effects may need
            shorter ones.
        effort_gain: (k,) force per unit of a measured effort [N m or N per unit]; empty for 1.
    """

    name: str
    joints: tuple[SimulatedJoint, ...]
    command_joints: tuple[str, ...]
    command_unit: str
    mechanism: Mechanism
    controllers: Mapping[str, ControllerChoice]
    sensors: Sensors
    torque_noise: tuple[float, ...]
    rate_hz: float = 100.0
    same_physics: Mapping[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    description: str = ''
    last_joint: str | None = None
    longest_substep_s: float = 1e-3
    effort_gain: tuple[float, ...] = ()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(joint.name for joint in self.joints)

    def absorbed(self, mechanism: Mechanism, effects: Iterable[EffectAt]) -> Mechanism:
        """Return the mechanism whose parameters hold those effects that are the same physics."""
        for effect in effects:
            names = self.same_physics.get((effect.name, effect.joint))
            if names is not None:
                value = getattr(mechanism, names[1]) + float(effect.parameters[names[0]])
                mechanism = replace(mechanism, **{names[1]: value})
        return mechanism
