"""URDF texts that tests simulate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_proof.concealed import robots


def arm(rng_seed=0, limit=None):
    """Return a planar arm of two driven joints named `shoulder` and `elbow`."""
    bodies = robots.planar_arm(np.random.default_rng(rng_seed))
    for body, name in zip(bodies, ('shoulder', 'elbow'), strict=True):
        object.__setattr__(body, 'joint', name)
        object.__setattr__(body, 'link', f'{name}_link')
        if limit is not None:
            object.__setattr__(body, 'limit', limit)
    return robots.urdf('arm', bodies)


def spatial_arm(rng_seed=0):
    """Return an arm of three joints, one about z and two about y."""
    bodies = robots.yaw_pitch_pitch(np.random.default_rng(rng_seed))
    named = [replace(b, joint=f'j{i}', link=f'link_{i}') for i, b in enumerate(bodies)]
    return robots.urdf('spatial', named)


def pendulum(mass=2.0, length=0.5, inertia=0.1):
    """Return a pendulum about y that hangs along -z, its body at `length` from the axis."""
    return f"""<robot name="pendulum"><link name="world"/>
      <link name="bob"><inertial><origin xyz="0 0 {-length}"/><mass value="{mass}"/>
        <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
      </inertial></link>
      <joint name="hinge" type="continuous"><parent link="world"/><child link="bob"/>
        <axis xyz="0 1 0"/></joint>
      <link name="tool0"/><joint name="tool" type="fixed"><parent link="bob"/>
        <child link="tool0"/><origin xyz="0 0 -1"/></joint></robot>"""
