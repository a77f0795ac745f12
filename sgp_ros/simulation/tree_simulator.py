"""Simulators of robots that are described by a URDF."""

from __future__ import annotations

from sgp_ros.simulation.controllers import (
    ControllerChoice,
    external,
    middle_and_reach,
    multisine_tracking,
    zero,
)
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.sensors import Sensors, encoder_resolution
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.tree import Tree
from sgp_ros.simulation.tree_text import TreePart
from sgp_ros.simulation.tree_xml import STAND_IN_MASS, STAND_IN_RADIUS

_BITS = 17
_LINEAR_RESOLUTION_M = 1e-6
_RATE_HZ = 200.0
_LONGEST_SUBSTEP_S = 4e-3


def tree_simulator(urdf: str, part: TreePart | None = None) -> Simulator:
    """Return the simulator of a URDF text; its commands are the forces of the motors.

    Args:
        urdf: the text.
        part: what of it is simulated, and in which unit efforts are commanded and measured; None
            for all in N m or N.

    Raises:
        ConfigError: a URDF that is not a tree of bodies with inertia, or MuJoCo is missing.
    """
    tree = Tree(urdf, part)
    joints, commanded = tree.text.joints, tree.text.command_joints
    names = tuple(joint.name for joint in joints)
    gains = tuple(float(x) for x in tree.gains(names))
    is_scaled = any(gain != 1.0 for gain in gains)
    return Simulator(
        name=tree.text.name,
        joints=joints,
        command_joints=commanded,
        command_unit='1 / effort_gain' if is_scaled else 'N m or N',
        mechanism=tree,
        controllers=_controllers(tree, joints),
        sensors=Sensors(
            resolution=tuple(
                _LINEAR_RESOLUTION_M if joint.is_prismatic else encoder_resolution(_BITS)
                for joint in joints
            ),
            measures_velocity=True,
        ),
        torque_noise=(0.0,) * len(joints),
        rate_hz=_RATE_HZ,
        description=_description(tree),
        last_joint=tree.text.last_joint,
        longest_substep_s=_LONGEST_SUBSTEP_S,
        effort_gain=gains,
    )


def _description(tree: Tree) -> str:
    if not tree.text.stand_ins:
        return f'Rigid-body robot {tree.text.name}'
    return (
        f'Robot {tree.text.name} without masses: each link is a ball of {STAND_IN_MASS:g} kg and '
        f'{STAND_IN_RADIUS:g} m radius, so its efforts are not those of a real machine'
    )


def _controllers(tree: Tree, joints: tuple[SimulatedJoint, ...]) -> dict[str, ControllerChoice]:
    """Return the controllers; without motors the robot is let go beside the middle."""
    names, commanded = [joint.name for joint in joints], tree.text.command_joints
    middle, reach = middle_and_reach(joints)
    start = middle if commanded else middle + 0.5 * reach
    rest = tuple(float(x) for x in start), (0.0,) * len(joints)
    usual = {
        'zero': ControllerChoice(zero(len(commanded)), *rest),
        'external': ControllerChoice(external, *rest),
    }
    if not commanded:
        return usual
    motors = tuple(names.index(name) for name in commanded)
    build = multisine_tracking(joints, motors, tree.gains(commanded))
    return {'tracking': ControllerChoice(build, *rest), **usual}
