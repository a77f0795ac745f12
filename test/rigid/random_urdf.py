"""Random robots as URDF text: branched, prismatic, rotated, with fixed and following joints."""

from __future__ import annotations

import numpy as np


def random_urdf(seed, joints, mimics=0, fixed=2):
    """Return a URDF with `joints` moving joints of which the last `mimics` follow others."""
    rng = np.random.default_rng(seed)
    lines = [f'<robot name="tree_{seed}">', '<link name="base"/>']
    links, kinds = ['base'], []
    for i in range(joints + fixed):
        is_moving = i < joints
        name = f'{"j" if is_moving else "f"}{i}'
        kind = rng.choice(['revolute', 'continuous', 'prismatic']) if is_moving else 'fixed'
        kinds.append(kind)
        # half of them a chain, the others branches
        parent = links[-1] if rng.random() < 0.5 else rng.choice(links)
        links.append(f'link_{name}')
        lines += [_link(rng, links[-1]), _joint(rng, name, kind, parent, links[-1])]
        if is_moving and i >= joints - mimics:
            leader = int(rng.integers(0, i))
            multiplier, offset = rng.normal(size=2)
            lines.append(f'<mimic joint="j{leader}" multiplier="{multiplier}" offset="{offset}"/>')
        lines.append('</joint>')
    return '\n'.join([*lines, '</robot>'])


def _vector(values):
    return ' '.join(repr(float(x)) for x in values)


def _link(rng, name):
    root = rng.normal(size=(3, 3))
    tensor = root @ root.T + np.eye(3)
    entries = ' '.join(
        f'i{a}{b}="{tensor["xyz".index(a), "xyz".index(b)]}"'
        for a, b in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
    )
    return (
        f'<link name="{name}"><inertial>'
        f'<origin xyz="{_vector(rng.normal(size=3))}" rpy="{_vector(rng.normal(size=3))}"/>'
        f'<mass value="{rng.uniform(0.5, 3.0)}"/><inertia {entries}/></inertial></link>'
    )


def _joint(rng, name, kind, parent, child):
    axis = rng.normal(size=3) if rng.random() < 0.7 else rng.permutation([0.0, 0.0, 1.0])
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_vector(rng.normal(size=3))}" rpy="{_vector(rng.normal(size=3))}"/>'
        f'<axis xyz="{_vector(axis)}"/>'
        f'<limit lower="-1" upper="2" effort="{rng.uniform(5, 50)}" velocity="3"/>'
        f'<dynamics damping="{rng.uniform(0.1, 1.0)}" friction="{rng.uniform(0.1, 1.0)}"/>'
    )
