"""Speed of the torque regressor of a seven-joint arm, compared with Pinocchio and memory.

A chain of seven revolute joints with arbitrary axes and offsets; random positions, velocities and
accelerations. Ours fills all samples of a batch in one call, into memory used before (`out`) or
into fresh memory. Pinocchio is called from a Python loop, its result dropped. The floor is the
time to write as many bytes as the regressor has, at the write bandwidth measured by filling the
same memory with a constant. One thread; medians over repeats.

    python -m sgp_proof.numerics.regressor --repeats 15
"""

from __future__ import annotations

import os

for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

import numpy as np
import pinocchio

from sgp_proof.bench.problem import least_seconds
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.rigid.inertial import revolute_chain
from sgp_ros.rigid.rigid_body import forward_dynamics, inverse_dynamics, torque_regressor

SEED = 0
JOINTS = 7
BATCHES = (1, 100, 4000)
LOOPED = 4000


def chain(rng):
    """Return the same random arm as a tree of ours and as a model of Pinocchio."""
    axes = rng.normal(size=(JOINTS, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    offsets = rng.normal(scale=0.3, size=(JOINTS, 3))
    model = pinocchio.Model()
    parent = 0
    for i in range(JOINTS):
        joint = pinocchio.JointModelRevoluteUnaligned(axes[i])
        parent = model.addJoint(parent, joint, pinocchio.SE3(np.eye(3), offsets[i]), f'j{i}')
    return revolute_chain([f'j{i}' for i in range(JOINTS)], axes, offsets), model


def pinocchio_loop(model, q, v, a):
    """Compute the regressor of each sample, one call each."""
    data = model.createData()
    for sample in zip(q, v, a, strict=True):
        pinocchio.computeJointTorqueRegressor(model, data, *sample)


def batch_row(tree, size, rng, repeats):
    """Return what one batch size costs per sample [us]."""
    q, v, a = rng.normal(size=(3, size, JOINTS))
    out = np.empty((size, JOINTS, 10 * JOINTS))
    loops = max(1, LOOPED // size)
    parameters = np.tile([2.0, 0.1, 0.1, 0.1, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1], (JOINTS, 1))
    works = {
        'regressor_us': lambda: torque_regressor(tree, q, v, a, out),
        'regressor_fresh_memory_us': lambda: torque_regressor(tree, q, v, a),
        'floor_us': lambda: out.fill(1.0),
        'inverse_dynamics_us': lambda: inverse_dynamics(tree, parameters, q, v, a),
        'forward_dynamics_us': lambda: forward_dynamics(tree, parameters, q, v, a),
    }
    row = {'samples': size}
    for name, work in works.items():
        row[name] = 1e6 * least_seconds(work, repeats, loops) / size
    row['samples_per_s'] = 1e6 / row['regressor_us']
    row['times_floor'] = row['regressor_us'] / row['floor_us']
    return row


def main() -> None:
    """Print and write the cost per sample."""
    parser = make_parser(__doc__, 'regressor')
    parser.add_argument('--repeats', type=int, default=15)
    arguments = parser.parse_args()
    rng = np.random.default_rng(SEED)
    tree, model = chain(rng)
    q, v, a = rng.normal(size=(3, LOOPED, JOINTS))
    looped = least_seconds(lambda: pinocchio_loop(model, q, v, a), arguments.repeats)
    theirs = 1e6 * looped / LOOPED
    expected = pinocchio.computeJointTorqueRegressor(model, model.createData(), q[0], v[0], a[0])
    error = np.abs(torque_regressor(tree, q[:1], v[:1], a[:1])[0] - expected).max()
    rows = [batch_row(tree, size, rng, arguments.repeats) for size in BATCHES]
    result = {
        'seed': SEED,
        'repeats': arguments.repeats,
        'joints': JOINTS,
        'bytes_per_sample': 8 * 10 * JOINTS**2,
        'largest_difference_over_largest_entry': float(error / np.abs(expected).max()),
        'pinocchio_loop_us': theirs,
        'batches': rows,
    }
    write_result(arguments.out, result, 'pin')
    print(f'Pinocchio in a Python loop: {theirs:.2f} us a sample')
    for row in rows:
        print(', '.join(f'{name} {value:.4g}' for name, value in row.items()))


if __name__ == '__main__':
    main()
