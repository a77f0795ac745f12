"""Names of the places at which effects act, in the words of the schema."""

from __future__ import annotations

from sgp_ros.robots.observed_motion import ObservedMotion

PLACES = {-1: 'base', -2: 'tool', -3: 'all'}


def joint_name(motion: ObservedMotion, joint: int) -> str:
    """Return the name of a joint as in the schema."""
    return PLACES.get(joint) or motion.tree.joint_names[joint]
