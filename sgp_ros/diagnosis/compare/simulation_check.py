"""Whether the nominal robot describes the recording of its simulation.

The nominal values of the robot are the reference of a diagnosis, not a fit to the simulation:
where the two agree a fit would add nothing but its own error, and where they do not, the wrong
parameters and findings would no longer be those of the robot that was given.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import choose_bandwidth, collect
from sgp_ros.diagnosis.decide.decision import LEAST_SHARE
from sgp_ros.engine.samples import Event
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.robot import Robot


def nominal_shares(
    events: Iterable[Event], robot: Robot, tree: Tree, stated: tuple[EffectAt, ...] = ()
) -> dict[str, float]:
    """Return the share of the mean squared effort that the nominal robot leaves, by joint.

    Args:
        events: of the simulation.
        robot: names, actuated joints and gains.
        tree: nominal robot.
        stated: effects that the nominal robot has, beside those of its tree.

    Raises:
        RecordingError: too little motion, or none of the joints.
    """
    raw = collect(events, robot, stated)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    shares = (equations.d**2).mean(axis=0) / equations.power
    return dict(zip(tree.moving_names, map(float, shares), strict=True))


def disagreement(shares: Mapping[str, float], recording: str) -> str:
    """Return a sentence on what the nominal robot leaves of a simulation; empty if little."""
    worst = max(shares, key=lambda name: shares[name])
    if shares[worst] < LEAST_SHARE:
        return ''
    return (
        f'The robot does not describe {recording}: it leaves {100.0 * shares[worst]:.2g} % of '
        f'the mean squared effort of {worst} there, and {100.0 * LEAST_SHARE:.2g} % count as '
        'physics. What is found is what the real robot has beyond the nominal one; the '
        'simulation may have some of it too.'
    )
