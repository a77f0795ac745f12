"""A robot of 30 joints, replayed: seconds of the processor a second of data.

    python -m sgp_proof.streams.many_joints

A humanoid-like tree of bodies that are drawn: a waist, a neck, two arms and two legs. It moves on
sums of sines, one set a joint; efforts come from its inverse dynamics with friction that its model
file does not state, and noise. The stream goes through the engine as `sgp replay` has it go, with
default settings, fits of hyper-parameters among them.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

LIMBS = {'waist': 2, 'neck': 2, 'left_arm': 7, 'right_arm': 7, 'left_leg': 6, 'right_leg': 6}
SECONDS = 40.0
NOISE, COULOMB, VISCOUS = 0.02, 0.3, 0.1
"""Of efforts [N m], [N m] and [N m s/rad]."""
RATES = {'100Hz': 100.0, '200Hz': 200.0}


def urdf(seed):
    """Return the tree: every joint turns about an axis of its own, arms and neck on the waist."""
    rng = np.random.default_rng(seed)
    links, joints = ['<link name="base"/>'], []
    for limb, number in LIMBS.items():
        parent = 'base' if limb.endswith('leg') or limb == 'waist' else f'waist{LIMBS["waist"]}'
        for i in range(1, number + 1):
            name = f'{limb}{i}'
            axis = rng.normal(size=3)
            x, y, z = axis / np.linalg.norm(axis)
            mass = rng.uniform(0.3, 3.0)
            inertia = ' '.join(f'{k}="{0.01 * mass:.6f}"' for k in ('ixx', 'iyy', 'izz'))
            links.append(
                f'<link name="{name}"><inertial><origin xyz="0 0 {rng.uniform(0.02, 0.1):.4f}"/>'
                f'<mass value="{mass:.4f}"/><inertia {inertia} ixy="0" ixz="0" iyz="0"/>'
                '</inertial></link>'
            )
            joints.append(
                f'<joint name="{name}_joint" type="continuous"><parent link="{parent}"/>'
                f'<child link="{name}"/><origin xyz="0 0 0.2"/>'
                f'<axis xyz="{x:.6f} {y:.6f} {z:.6f}"/></joint>'
            )
            parent = name
    return '\n'.join(['<robot name="humanoid">', *links, *joints, '</robot>'])


def _stream(robot, seed, rate_hz):
    """Return the states of the motion, with measured velocities and efforts."""
    rng = np.random.default_rng((seed, 1))
    tree = nominal_model(robot).tree
    k = len(robot.joints)
    t = np.arange(round(SECONDS * rate_hz)) / rate_hz
    rate = 2.0 * np.pi * rng.uniform(0.1, 0.6, size=(k, 3))
    angle = rate * t[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, size=(k, 3))
    q = 0.3 * np.sin(angle).sum(axis=2)
    v = 0.3 * (np.cos(angle) * rate).sum(axis=2)
    a = -0.3 * (np.sin(angle) * rate**2).sum(axis=2)
    effort = inverse_dynamics(tree, tree.parameters, q, v, a)
    effort += COULOMB * np.tanh(v / 0.01) + VISCOUS * v + NOISE * rng.standard_normal(v.shape)
    q += 1e-5 * rng.standard_normal(q.shape)
    v += 1e-3 * rng.standard_normal(v.shape)
    stamps = 10**18 + np.round(1e9 * t).astype(np.int64)
    return [
        JointSample(int(stamp), robot.joint_names, *map(frozen_array, row))
        for stamp, *row in zip(stamps, q, v, effort, strict=True)
    ]


def _measure(robot, events):
    engine = Engine(robot, EngineConfig.from_mapping({}, robot))
    marks = []

    def push(event):
        began = time.process_time()
        step = engine.push(event)
        marks.append((began, time.process_time(), len(step.estimates)))
        return step

    began = time.monotonic(), time.process_time()
    replay(engine, events, lambda _: None, push=push)
    elapsed, spent = time.monotonic() - began[0], time.process_time() - began[1]
    first, last, equations = np.array(marks).T
    between = np.append(first[1:], began[1] + spent) - last  # in which fits are done
    half = len(events) // 2  # from which on the buffer is full
    nmse = [score[robot.target].nmse for score in engine.scores().values()]
    return {
        'elapsed_per_s': elapsed / SECONDS, 'load': spent / SECONDS,
        'load_of_fits': between.sum() / SECONDS,
        'load_later': (began[1] + spent - first[half]) / (0.5 * SECONDS),
        'longest_step_s': (last - first).max(), 'longest_fit_s': between.max(),
        'fits': engine.fits, 'refits': engine.counts.refits,
        'equations': int(equations.sum()), 'learned': engine.counts.learned,
        'nmse_median': float(np.median(nmse)), 'nmse_worst': float(np.max(nmse)),
    }  # fmt: skip


def main():
    """Measure at every rate and write the result."""
    parser = make_parser(__doc__, 'many_joints', RATES)
    arguments = parser.parse_args()
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'humanoid.urdf'
        path.write_text(urdf(0), encoding='utf-8')
        robot = load_robot(str(path))
        for name in arguments.names:
            found[name] = _measure(robot, _stream(robot, 0, RATES[name]))
            print(name, found[name], flush=True)
    sizes = {'joints': len(robot.joints), 'coefficients': len(robot.coefficients)}
    write_result(arguments.out, {**sizes, 'data_s': SECONDS, 'runs': found})


if __name__ == '__main__':
    main()
