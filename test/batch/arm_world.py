"""A small arm from a URDF whose recorded efforts are those of Pinocchio's inverse dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio

from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.recordings.writer import RecordingWriter

JOINTS = ('turn', 'lift')
VISCOUS = np.array([0.5, 0.3])
COULOMB = np.array([0.4, 0.3])
WIDTH = 0.01
"""Speed over which dry friction changes its sign [rad/s], the default of a robot file."""
START_NS = 1_700_000_000_000_000_000
URDF = """<robot name="small_arm">
  <link name="base"/>
  <link name="column"><inertial><origin xyz="0.02 0.01 0.1"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="-0.001" izz="0.025"/></inertial>
    </link>
  <link name="fore"><inertial><origin xyz="0.2 0.01 0.02"/><mass value="1.2"/>
    <inertia ixx="0.004" ixy="0.0005" ixz="0.0003" iyy="0.02" iyz="0.0002" izz="0.021"/>
    </inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="column"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit effort="50" velocity="5"/>
    <dynamics damping="0.5" friction="0.4"/></joint>
  <joint name="lift" type="continuous"><parent link="column"/><child link="fore"/>
    <origin xyz="0 0.1 0.2"/><axis xyz="0 1 0"/><limit effort="50" velocity="5"/>
    <dynamics damping="0.3" friction="0.3"/></joint>
</robot>
"""
MODEL = pinocchio.buildModelFromXML(URDF)


def arm_motion(seconds=24.0, rate=100.0, seed=0):
    """Return time (n,), positions, velocities and accelerations (n, 2) of eight sinusoids."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    omega = 2.0 * np.pi * rng.uniform(0.1, 0.7, (8, 2))
    angle = t[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, (8, 2))
    q = 0.3 * np.sin(angle).sum(axis=1)
    v = 0.3 * (omega * np.cos(angle)).sum(axis=1)
    a = -0.3 * (omega**2 * np.sin(angle)).sum(axis=1)
    return t, q, v, a


def arm_efforts(q, v, a):
    """Return the efforts of bodies and friction, (n, 2) [N m]."""
    data = MODEL.createData()
    rigid = [
        pinocchio.rnea(MODEL, data, _places(row), *rest)
        for row, *rest in zip(q, v, a, strict=True)
    ]
    return np.array(rigid) + VISCOUS * v + COULOMB * np.tanh(v / WIDTH)


def arm_samples(seconds=24.0, *, rate=100.0, seed=0, encoder=2e-5, noise=0.02):
    """Return states of the arm with velocities and efforts.

    Args:
        seconds: length [s].
        rate: [Hz].
        seed: of motion and noise.
        encoder: standard deviation of the positions [rad].
        noise: standard deviation of the efforts [N m].
    """
    t, q, v, a = arm_motion(seconds, rate, seed)
    rng = np.random.default_rng(1000 + seed)
    effort = arm_efforts(q, v, a) + noise * rng.normal(size=q.shape)
    seen = q + encoder * rng.normal(size=q.shape), v + 50 * encoder * rng.normal(size=q.shape)
    return [
        JointSample(START_NS + round(1e9 * time), JOINTS, *(frozen_array(x) for x in row))
        for time, *row in zip(t, *seen, effort, strict=True)
    ]


def passive_samples(seconds=24.0, rate=50.0):
    """Return states of the arm whose second joint swings freely, integrated by Pinocchio."""
    data, rng, h = MODEL.createData(), np.random.default_rng(0), 0.005
    omega, phase = 2.0 * np.pi * rng.uniform(0.2, 1.2, 5), rng.uniform(0.0, 6.0, 5)

    def effort(t):
        return np.array([1.2 * np.sin(omega * t + phase).sum(), 0.0])

    def rate_of(t, x):
        friction = VISCOUS * x[2:] + COULOMB * [1.0, 0.3] * np.tanh(x[2:] / WIDTH)
        a = pinocchio.aba(MODEL, data, _places(x[:2]), x[2:], effort(t) - friction)
        return np.concatenate([x[2:], a])

    x, samples = np.array([0.0, 1.0, 0.0, 0.0]), []
    for i in range(round(seconds / h)):
        t = i * h
        if i % round(1.0 / (rate * h)) == 0:
            seen = x[:2] + 1e-5 * rng.normal(size=2)
            felt = np.array([effort(t)[0] + 0.01 * rng.normal(), np.nan])
            row = (frozen_array(y) for y in (seen, x[2:], felt))
            samples.append(JointSample(START_NS + round(1e9 * t), JOINTS, *row))
        k1 = rate_of(t, x)
        k2 = rate_of(t + 0.5 * h, x + 0.5 * h * k1)
        k3 = rate_of(t + 0.5 * h, x + 0.5 * h * k2)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate_of(t + h, x + h * k3))
    return samples


def write_bag(path, samples):
    """Write states as MCAP and return the path as text."""
    with RecordingWriter(path) as writer:
        for sample in samples:
            writer.write_event(sample)
    return str(path)


def write_arm(folder, lines=''):
    """Write the URDF and a robot file with more lines; return the path of the latter as text."""
    (folder / 'arm.urdf').write_text(URDF)
    (folder / 'arm.yaml').write_text(f'schema: 1\nurdf: arm.urdf\n{lines}')
    return str(folder / 'arm.yaml')


def _places(q):
    """Return the configuration of two continuous joints in Pinocchio's form."""
    return np.array([np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1])])
