"""Simulators of robots that are described by a URDF."""

from __future__ import annotations

from sgp_ros.simulation.controllers import ControllerChoice, external, zero
from sgp_ros.simulation.sensors import Sensors, encoder_resolution
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.tracking import middle_and_reach, multisine_tracking
from sgp_ros.simulation.tree import Tree

_BITS = 17
_LINEAR_RESOLUTION_M = 1e-6
_RATE_HZ = 200.0
_LONGEST_SUBSTEP_S = 4e-3


def tree_simulator(urdf: str) -> Simulator:
    """Return the simulator of a URDF text; its commands are the forces of the motors.

    Raises:
        ConfigError: a URDF that is no tree of bodies with inertia, or MuJoCo is missing.
    """
    tree = Tree(urdf)
    joints, commanded = tree.text.joints, tree.text.command_joints
    names = tuple(joint.name for joint in joints)
    motors = tuple(names.index(name) for name in commanded)
    middle, _ = middle_and_reach(joints)
    start = tuple(float(x) for x in middle), (0.0,) * len(joints)
    return Simulator(
        name=tree.text.name,
        joints=joints,
        command_joints=commanded,
        command_unit='N m or N',
        mechanism=tree,
        controllers={
            'tracking': ControllerChoice(multisine_tracking(joints, motors), *start),
            'zero': ControllerChoice(zero(len(commanded)), *start),
            'external': ControllerChoice(external, *start),
        },
        sensors=Sensors(
            resolution=tuple(
                _LINEAR_RESOLUTION_M if joint.is_prismatic else encoder_resolution(_BITS)
                for joint in joints
            ),
            measures_velocity=True,
        ),
        torque_noise=(0.0,) * len(joints),
        rate_hz=_RATE_HZ,
        description='The robot of a URDF',
        last_joint=tree.text.last_joint,
        longest_substep_s=_LONGEST_SUBSTEP_S,
    )
