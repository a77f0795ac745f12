"""Machines as they stand in works and labs: arms, gantries, pendulums with geared motors.

Beside its bodies a machine has at every joint dry and viscous friction and the rotor of a motor
behind a gear. What of it the robot file states and what is concealed is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sgp_proof.concealed.robots import AHEAD, DOWN, UP, Body, X, Y, Z, _rod

_ARMS = {
    2: ((Y, Y), (Z, Z), (Z, Y)),
    3: ((Z, Y, Y),),
    4: ((Z, Y, Y, Y), (Z, Y, Y, X)),
    5: ((Z, Y, Y, Y, X),),
    6: ((Z, Y, Y, X, Y, X),),
    7: ((Z, Y, Z, Y, Z, Y, Z),),
}
"""Axes of arms by number of joints, stretched upwards to the elbow and ahead from there on."""
_SHARES = (0.05, 0.3, 0.15, 0.1, 0.35, 0.05)
"""How often arms of each number of joints are drawn."""
_MASS = (1.0, 0.8, 0.45, 0.2, 0.13, 0.08, 0.05)
"""Masses of the links of an arm, relative to the first one."""
_LENGTH = (0.25, 0.3, 0.27, 0.1, 0.09, 0.07, 0.05)
"""Their lengths, relative to the reach."""
FAMILIES = {'arm': 0.7, 'gantry': 0.15, 'pendulum': 0.15}
"""Families with how often they are drawn."""


@dataclass(frozen=True)
class Gear:
    """Drive of a joint: gear, rotor and usual motion.

    Attributes:
        ratio: of the gear [1].
        inertia: of the rotor, seen at the joint [kg m^2 or kg].
        speed: of usual motion [rad/s or m/s].
        acceleration: of usual motion [rad/s^2 or m/s^2].
    """

    ratio: float
    inertia: float
    speed: float
    acceleration: float


def draw_machine(rng, largest_joints=7):
    """Return family and bodies of a random machine; the robot file states no friction yet."""
    family = str(rng.choice(list(FAMILIES), p=list(FAMILIES.values())))
    if family == 'gantry':
        bodies = _gantry(rng, min(int(rng.integers(2, 4)), largest_joints))
    elif family == 'pendulum':
        bodies = _pendulum(rng, min(int(rng.integers(1, 3)), largest_joints))
    else:
        count = int(rng.choice(list(_ARMS), p=_SHARES))
        bodies = _arm(rng, min(count, largest_joints))
    return family, [
        replace(body, joint=f'joint_{i + 1}', link=f'link_{i + 1}')
        for i, body in enumerate(bodies)
    ]


def draw_gears(rng, bodies, inertia):
    """Return the gear of each joint.

    Args:
        rng: of the machine.
        bodies: of the machine.
        inertia: (k,) diagonal of the mass matrix in the middle of the motion [kg m^2 or kg].
    """
    speed = rng.uniform(0.4, 2.0)
    gears = []
    for i, (body, own) in enumerate(zip(bodies, inertia, strict=True)):
        is_wrist = i >= 3
        share = rng.uniform(1.0, 5.0) if is_wrist else rng.uniform(0.3, 1.5)
        fast = speed * rng.uniform(0.7, 1.3) * (0.2 if body.is_prismatic else 1.0 + is_wrist)
        gears.append(
            Gear(
                float(rng.uniform(30.0, 160.0)),
                float(share * own + 0.002 * inertia[0] * is_wrist),
                float(fast),
                float(fast / rng.uniform(0.1, 0.4)),
            )
        )
    return gears


def _body(parent, rod, axis, xyz, span, kind='revolute', limit=2.9):
    return Body('', '', kind, axis, tuple(xyz), (0, 0, 0), parent, **rod, damping=0.0,
                limit=limit, span=span)  # fmt: skip


def _arm(rng, count):
    axes = _ARMS[count][int(rng.integers(len(_ARMS[count])))]
    reach = rng.uniform(0.5, 1.6)
    mass = 12.0 * reach**2 * rng.uniform(0.6, 1.6)
    hangs = axes[0] is not Z
    bodies, xyz = [], (0.0, 0.0, 0.3)
    for i, axis in enumerate(axes):
        length = reach * _LENGTH[i] * rng.uniform(0.8, 1.2)
        if count == 2 and axes == (Z, Z):
            along = AHEAD
        elif hangs:
            along = DOWN
        else:
            along = UP if i < 2 or count == 7 else AHEAD
        rod = _rod(
            rng, mass * _MASS[i] * rng.uniform(0.8, 1.2), length, along, 0.12 * reach * _MASS[i]
        )
        bodies.append(_body(i - 1, rod, axis, xyz, rng.uniform(0.4, 1.2)))
        side = rng.normal(0.0, 0.02 * reach) * (rng.random() < 0.5)
        xyz = (rod['tip'][0], rod['tip'][1] + side, rod['tip'][2])
    return bodies


def _gantry(rng, count):
    axes = (X, Y, Z)[:count] if rng.random() < 0.6 else (Y, X, Z)[:count]
    bodies, xyz = [], (0.0, 0.0, 1.0)
    for i, axis in enumerate(axes):
        rod = _rod(rng, rng.uniform(8.0, 60.0) * 0.5**i, 0.3, DOWN if axis is Z else AHEAD, 0.05)
        reach = rng.uniform(0.1, 0.35)
        bodies.append(_body(i - 1, rod, axis, xyz, reach, 'prismatic', 2.5 * reach))
        xyz = (0.0, 0.05, 0.1)
    return bodies


def _pendulum(rng, count):
    length, bodies = rng.uniform(0.3, 0.6), []
    for i in range(count):
        rod = _rod(rng, rng.uniform(0.5, 3.0) * 0.6**i, length, DOWN)
        xyz = (0.0, 0.05, -length) if i else (0.0, 0.0, 1.0)
        bodies.append(_body(i - 1, rod, Y, xyz, rng.uniform(0.7, 1.6), limit=3.1))
        length *= 0.8
    return bodies
