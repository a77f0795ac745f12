"""Random robots of known families as URDF texts with nominal and with true inertial parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

DOWN, UP, AHEAD = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_NAMES = (
    'shoulder', 'elbow', 'wrist', 'hip', 'knee', 'ankle', 'yaw', 'pitch', 'roll', 'slide', 'lift',
    'swing', 'boom', 'turret', 'axis_a', 'axis_b', 'axis_c', 'j1', 'j2', 'j3', 'joint_4',
    'joint_5', 'pan', 'tilt', 'pole', 'wheel', 'carriage', 'stick', 'z_axis', 'base_joint',
)  # fmt: skip


@dataclass(frozen=True)
class Body:
    """A link and the joint that carries it; a motion goes as far as `span` from `centre`."""

    joint: str
    link: str
    kind: str
    axis: tuple
    xyz: tuple
    rpy: tuple
    parent: int
    mass: float
    com: np.ndarray
    inertia: np.ndarray
    tip: np.ndarray
    damping: float
    limit: float
    span: float
    effort: float = 1e4
    is_driven: bool = True
    centre: float = 0.0
    friction: float = 0.0

    @property
    def is_prismatic(self):
        return self.kind == 'prismatic'


def _rod(rng, mass, length, along, radius=0.03):
    """Return mass, centre and inertia of a rod with some lumps, and its end."""
    along = np.array(along)
    lumps = along * length * rng.uniform(0.2, 0.9, (3, 1)) + rng.normal(0.0, radius, (3, 3))
    share = rng.uniform(0.02, 0.08, 3)
    rod = mass * (1.0 - share.sum())
    centre = 0.5 * along * length
    com = (rod * centre + (mass * share) @ lumps) / mass
    thick = rod * radius**2 / 2.0
    tensor = (rod * length**2 / 12.0 + thick / 2.0) * (np.eye(3) - np.outer(along, along))
    tensor = tensor + thick * np.outer(along, along) + _steiner(rod, centre - com)
    for m, x in zip(mass * share, lumps, strict=True):
        tensor = tensor + _steiner(m, x - com)
    return {'mass': mass, 'com': com, 'inertia': tensor, 'tip': along * length}


def _steiner(mass, d):
    return mass * ((d @ d) * np.eye(3) - np.outer(d, d))


def _body(rng, parent, rod, kind='revolute', axis=Y, xyz=(0, 0, 0), rpy=(0, 0, 0), **other):
    is_linear = kind == 'prismatic'
    values = {
        'damping': rng.uniform(2.0, 12.0) if is_linear else rng.uniform(0.02, 0.1),
        'limit': 0.45 if is_linear else rng.uniform(2.4, 2.9),
        'span': rng.uniform(0.12, 0.2) if is_linear else rng.uniform(0.7, 1.2),
    } | other
    return Body('', '', kind, axis, tuple(xyz), tuple(rpy), parent, **rod, **values)


def pendulum(rng):
    kind = 'continuous' if rng.random() < 0.6 else 'revolute'
    rod = _rod(rng, rng.uniform(0.7, 1.6), rng.uniform(0.3, 0.6), DOWN)
    span = rng.uniform(1.0, 2.2)
    return [_body(rng, -1, rod, kind, xyz=(0, 0, 0.9), damping=rng.uniform(0.01, 0.06), span=span)]


def linear_axis(rng):
    rod = _rod(rng, rng.uniform(5.0, 40.0), 0.1, UP)
    axis = X if rng.random() < 0.7 else Z
    return [_body(rng, -1, rod, 'prismatic', axis, (0, 0, 0.4))]


def planar_arm(rng, *, first_is_driven=True):
    lengths = rng.uniform(0.25, 0.4, 2)
    axis = Y if rng.random() < 0.7 else X
    first = _rod(rng, rng.uniform(1.0, 2.5), lengths[0], DOWN)
    second = _rod(rng, rng.uniform(0.6, 1.5), lengths[1], DOWN)
    return [
        _body(rng, -1, first, axis=axis, xyz=(0, 0, 1), is_driven=first_is_driven),
        _body(rng, 0, second, axis=axis, xyz=(0, 0.05, -lengths[0]), span=rng.uniform(0.9, 1.4)),
    ]


def swinging_arm(rng):
    bodies = planar_arm(rng, first_is_driven=False)
    return [replace(bodies[0], damping=rng.uniform(0.01, 0.03)), bodies[1]]


def cart_pole(rng):
    cart = _rod(rng, rng.uniform(1.0, 3.0), 0.1, UP)
    pole = _rod(rng, rng.uniform(0.2, 0.5), rng.uniform(0.3, 0.5), DOWN, 0.01)
    return [
        _body(rng, -1, cart, 'prismatic', X, (0, 0, 0.5), damping=rng.uniform(0.5, 3.0),
              limit=0.8),
        _body(rng, 0, pole, 'continuous', Y, (0, 0.05, 0), is_driven=False,
              damping=rng.uniform(0.003, 0.01)),
    ]  # fmt: skip


def reaction_wheel(rng):
    length = rng.uniform(0.25, 0.35)
    pole = _rod(rng, rng.uniform(0.2, 0.4), length, DOWN, 0.01)
    mass, inertia = rng.uniform(0.25, 0.45), rng.uniform(8e-4, 2e-3)
    tensor = np.diag([0.55, 1.0, 0.55]) * inertia
    wheel = {'mass': mass, 'com': np.zeros(3), 'inertia': tensor, 'tip': np.zeros(3)}
    return [
        _body(rng, -1, pole, 'continuous', Y, (0, 0, 0.5), is_driven=False,
              damping=rng.uniform(0.003, 0.01)),
        _body(rng, 0, wheel, 'continuous', Y, (0, 0.03, -length), damping=rng.uniform(1e-4, 4e-4),
              span=rng.uniform(6.0, 14.0)),
    ]  # fmt: skip


def yaw_pitch_pitch(rng):
    lengths = rng.uniform(0.25, 0.4, 2)
    return [
        _body(rng, -1, _rod(rng, rng.uniform(1.5, 3.0), 0.15, UP, 0.06), axis=Z, xyz=(0, 0, 0.2)),
        _body(rng, 0, _rod(rng, rng.uniform(1.2, 2.5), lengths[0], UP), xyz=(0, 0, 0.2)),
        _body(rng, 1, _rod(rng, rng.uniform(0.6, 1.4), lengths[1], AHEAD),
              xyz=(0, 0.03, lengths[0])),
    ]  # fmt: skip


def scara(rng):
    return [
        _body(rng, -1, _rod(rng, rng.uniform(1.5, 3.0), 0.3, AHEAD), axis=Z, xyz=(0, 0, 0.4)),
        _body(rng, 0, _rod(rng, rng.uniform(0.8, 1.6), 0.25, AHEAD), axis=Z, xyz=(0.3, 0, 0)),
        _body(rng, 1, _rod(rng, rng.uniform(0.5, 1.5), 0.2, DOWN), 'prismatic', Z, (0.25, 0, 0),
              span=rng.uniform(0.05, 0.1), limit=0.25),
    ]  # fmt: skip


def random_tree(rng, is_branched=None):
    count = int(rng.integers(3, 7))
    is_branched = rng.random() < 0.3 if is_branched is None else is_branched
    bodies = []
    for i in range(count):
        parent = i - 1 if not is_branched or i < 2 else int(rng.integers(0, i))
        axis = np.eye(3)[rng.integers(3)] if rng.random() < 0.7 else rng.normal(size=3)
        axis = tuple(axis / np.linalg.norm(axis))
        rod = _rod(
            rng,
            3.0 * 0.7**i * rng.uniform(0.7, 1.3),
            rng.uniform(0.12, 0.3),
            DOWN if rng.random() < 0.6 else AHEAD,
            0.04,
        )
        kind = 'prismatic' if rng.random() < 0.12 else 'revolute'
        xyz = (0, 0, 0.8) if parent < 0 else bodies[parent].tip
        rpy = np.zeros(3) if rng.random() < 0.5 else rng.uniform(-1.0, 1.0, 3)
        span = rng.uniform(0.08, 0.15) if kind == 'prismatic' else rng.uniform(0.6, 1.1)
        bodies.append(_body(rng, parent, rod, kind, axis, xyz, rpy, span=span))
    return bodies


FAMILIES = {
    'pendulum': (pendulum, 3),
    'axis': (linear_axis, 3),
    'arm2': (planar_arm, 4),
    'arm3': (yaw_pitch_pitch, 4),
    'cartpole': (cart_pole, 2),
    'rwp': (reaction_wheel, 1.5),
    'acrobot': (swinging_arm, 1.5),
    'scara': (scara, 2),
    'tree': (random_tree, 4),
}
"""Name to what draws it and how often."""


def draw_robot(rng):
    """Return family and bodies of a random robot."""
    weight = np.array([weight for _, weight in FAMILIES.values()])
    family = str(rng.choice(list(FAMILIES), p=weight / weight.sum()))
    bodies = FAMILIES[family][0](rng)
    names = rng.choice(_NAMES, len(bodies), replace=False)
    return family, [
        replace(body, joint=str(name), link=f'{name}_link')
        for body, name in zip(bodies, names, strict=True)
    ]


def wrong(rng, bodies, largest, chance):
    """Return bodies with other inertial parameters, and what is other about them."""
    changed, errors = [], []
    for body in bodies:
        if rng.random() >= chance:
            changed.append(body)
            continue
        mass = float(np.exp(rng.uniform(-1.0, 1.0) * np.log1p(largest)))
        inertia = mass * float(np.exp(rng.uniform(-0.4, 0.4) * np.log1p(largest)))
        shift = 0.25 * largest * rng.uniform(-1.0, 1.0) * body.com
        changed.append(
            replace(
                body, mass=mass * body.mass, com=body.com + shift, inertia=inertia * body.inertia
            )
        )
        errors.append({'link': body.link, 'mass': mass, 'inertia': inertia, 'com': shift.tolist()})
    return changed, errors


def urdf(family, bodies):
    """Return the URDF; links and joints stand in the order of `bodies`."""
    lines = ['<?xml version="1.0"?>', f'<robot name="{family}">', '  <link name="ground"/>']
    for b in bodies:
        t = b.inertia
        lines.append(
            f'  <link name="{b.link}"><inertial><origin xyz="{_text(b.com)}" rpy="0 0 0"/>'
            f'<mass value="{b.mass:.10g}"/><inertia ixx="{t[0, 0]:.10g}" ixy="{t[0, 1]:.10g}" '
            f'ixz="{t[0, 2]:.10g}" iyy="{t[1, 1]:.10g}" iyz="{t[1, 2]:.10g}" '
            f'izz="{t[2, 2]:.10g}"/></inertial></link>'
        )
    for b in bodies:
        limits = '' if b.kind == 'continuous' else f'lower="{-b.limit:.4g}" upper="{b.limit:.4g}" '
        parent = 'ground' if b.parent < 0 else bodies[b.parent].link
        lines.append(
            f'  <joint name="{b.joint}" type="{b.kind}"><parent link="{parent}"/>'
            f'<child link="{b.link}"/><origin xyz="{_text(b.xyz)}" rpy="{_text(b.rpy)}"/>'
            f'<axis xyz="{_text(b.axis)}"/><limit {limits}effort="{b.effort:.4g}" '
            f'velocity="{500 if b.kind == "continuous" else 20}"/>'
            f'<dynamics damping="{b.damping:.4g}" friction="{b.friction:.4g}"/></joint>'
        )
    lines.append(
        f'  <link name="tool0"/>\n  <joint name="tool0_fixed" type="fixed"><parent '
        f'link="{bodies[-1].link}"/><child link="tool0"/><origin xyz="{_text(bodies[-1].tip)}" '
        'rpy="0 0 0"/></joint>\n  <ros2_control name="hw" type="system">\n'
        '    <hardware><plugin>vendor/System</plugin></hardware>'
    )
    for b in bodies:
        drive = '<command_interface name="effort"/>' if b.is_driven else ''
        lines.append(
            f'    <joint name="{b.joint}">{drive}<state_interface name="position"/>'
            '<state_interface name="velocity"/></joint>'
        )
    return '\n'.join([*lines, '  </ros2_control>', '</robot>', ''])


def _text(vector):
    return ' '.join(f'{x:.10g}' for x in vector)
