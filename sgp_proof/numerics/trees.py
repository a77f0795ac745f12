"""Random trees of joints: calibration of intervals, and flags of unidentifiable directions.

python -m sgp_proof.numerics.trees [--trees 210]
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

from dataclasses import dataclass

import numpy as np
import pinocchio
from scipy import linalg

from sgp_proof.numerics.random_tree import random_tree
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.errors import NumericalError
from sgp_ros.rigid.base_parameters import RegressorFactor, base_parameters
from sgp_ros.rigid.consistent import project_information
from sgp_ros.rigid.pseudo_inertia import is_consistent

SAMPLES, SECONDS, HARMONICS = 300, 20.0, 6
STILL, TINY, TINY_SIZE = 0.15, 0.1, 1e-3
NOISE_SHARE, NOISE_FLOOR = 0.02, 1e-3
"""Noise of a joint: share of the deviation of its torque, and the least noise [N m or N]."""
EXACT = 1e-15
"""Least new share of a column in extended precision, which rounds at 1e-19."""
CHUNK = 64


@dataclass(frozen=True)
class Outcome:
    """Counts of one tree; missed is called identifiable but is not, false the other way."""

    joints: int
    rank: int
    exact_rank: int
    structural_rank: int
    exact_structural_rank: int
    missed: int
    false: int
    inside: int
    intervals: int
    inside_alone: int
    intervals_alone: int
    least_value: float
    largest_zero: float
    tolerance: float
    inconsistent_before: int
    inconsistent_after: int | None
    distance_before: float
    distance_after: float | None


def pinocchio_model(tree):
    """Return the Pinocchio model of a tree without friction."""
    model = pinocchio.Model()
    for j, parent in enumerate(tree.parents):
        kind = (
            pinocchio.JointModelPrismaticUnaligned
            if tree.is_prismatic[j]
            else pinocchio.JointModelRevoluteUnaligned
        )
        place = pinocchio.SE3(tree.rotations[j], tree.offsets[j])
        joint = model.addJoint(parent + 1, kind(tree.axes[j]), place, f'j{j}')
        inertia = pinocchio.Inertia.FromDynamicParameters(tree.inertias[j])
        model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    return model


def regressor(model, q, v, a):
    """Return the columns of the robot under study, (n, k, 12 k); any other may stand here."""
    n, k = q.shape
    data = model.createData()
    F = np.zeros((n, k, 12 * k))
    for i in range(n):
        F[i, :, : 10 * k] = pinocchio.computeJointTorqueRegressor(model, data, q[i], v[i], a[i])
    F[:, range(k), range(10 * k, 11 * k)] = v
    F[:, range(k), range(11 * k, 12 * k)] = np.sign(v)
    return F


def true_torque(model, tree, q, v, a):
    """Return the torque by Newton and Euler, plus friction, (n, k)."""
    data = model.createData()
    rigid = np.array([pinocchio.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
    return rigid + tree.viscous * v + tree.coulomb * np.sign(v)


def random_motion(rng, k):
    """Return band-limited q, v, a, (n, k) each; some joints stand still or hardly move."""
    time = np.linspace(0.0, SECONDS, SAMPLES)
    frequency = 2.0 * np.pi * rng.uniform(0.05, 0.6, size=(k, HARMONICS))
    phase = frequency * time[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, size=(k, HARMONICS))
    size = rng.uniform(0.2, 1.0, size=(k, HARMONICS))
    size *= rng.uniform(0.5, 1.2, size=(k, 1)) / size.sum(axis=1, keepdims=True)
    luck = rng.random(k)
    luck[rng.integers(k)] = 1.0  # one joint moves
    size[luck < STILL + TINY] *= TINY_SIZE
    size[luck < STILL] = 0.0
    q = rng.uniform(-1.0, 1.0, size=k) + (size * np.sin(phase)).sum(axis=2)
    v = (size * frequency * np.cos(phase)).sum(axis=2)
    a = -(size * frequency**2 * np.sin(phase)).sum(axis=2)
    return q, v, a


def exact_identifiability(F):
    """Return rank and flags by Householder reflections with pivots in extended precision."""
    A = F.reshape(-1, F.shape[-1]).copy()  # (n k, p)
    p = A.shape[1]
    norms = np.sqrt((A * A).sum(axis=0))
    present = norms > EXACT * norms.max()
    A = A / np.where(present, norms, 1)
    A[:, ~present] = 0
    order = np.arange(p)
    rank = 0
    while rank < min(A.shape):
        rest = (A[rank:, rank:] ** 2).sum(axis=0)
        best = rank + int(np.argmax(rest))
        if rest.max() <= EXACT**2:
            break
        A[:, [rank, best]] = A[:, [best, rank]]
        order[[rank, best]] = order[[best, rank]]
        x = A[rank:, rank].copy()
        x[0] += np.copysign(np.sqrt((x * x).sum()), x[0])
        x /= np.sqrt((x * x).sum())
        A[rank:, rank:] -= 2 * np.outer(x, x @ A[rank:, rank:])
        rank += 1
    K = A[:rank, rank:].copy()
    for i in range(rank - 1, -1, -1):
        K[i] = (K[i] - A[i, i + 1 : rank] @ K[i + 1 :]) / A[i, i]
    identifiable = np.zeros(p, dtype=bool)
    identifiable[order[:rank]] = np.all(np.abs(K) <= 1e-7, axis=1)
    return rank, identifiable


def weighted_fit(F, y):
    """Return base parameters, estimate and deviation of them, and the noise of each joint.

    Weighted least squares; the noise of a joint is its residual over its share of the degrees of
    freedom, repeated until it settles.
    """
    n, k, p = F.shape
    noise = y.std(axis=0) + NOISE_FLOOR
    for _ in range(8):
        rows = (F / noise[:, None]).reshape(-1, p)
        factor = RegressorFactor.nothing(p)
        for chunk in np.array_split(rows, max(len(rows) // CHUNK, 1)):
            factor = factor.with_rows(chunk)
        base = factor.base_parameters([f'w{i}' for i in range(p)])
        scale = base.scale[list(base.independent)]
        Q, R = np.linalg.qr(rows[:, base.independent] / scale)
        beta = linalg.solve_triangular(R, Q.T @ (y / noise).ravel())
        residual = (y / noise).ravel() - rows[:, base.independent] @ (beta / scale)
        spent = (Q * Q).sum(axis=1).reshape(n, k).sum(axis=0)
        share = np.sqrt((residual.reshape(n, k) ** 2).sum(axis=0) / (n - spent))
        noise = noise * share
        if np.allclose(share, 1.0, rtol=1e-4):
            break
    spread = linalg.solve_triangular(R, np.eye(base.rank))
    return base, factor, beta / scale, np.sqrt((spread**2).sum(axis=1)) / scale, noise


def study(seed, joints):
    """Identify one random tree and judge what is said of its parameters."""
    rng = np.random.default_rng([seed, joints])
    tree = random_tree(rng, joints)
    model = pinocchio_model(tree)
    motion = random_motion(rng, joints)
    clean = true_torque(model, tree, *motion)
    sigma = NOISE_FLOOR + NOISE_SHARE * clean.std(axis=0)
    y = clean + sigma * rng.normal(size=clean.shape)
    F = regressor(model, *motion)
    base, factor, beta, deviation, _ = weighted_fit(F, y)
    truth = tree.parameters
    inside = np.abs(beta - base.combinations @ truth) <= 1.96 * deviation
    alone = base.identifiable[list(base.independent)]

    exact_rank, exact = exact_identifiability(tree.columns(*motion, precision=np.longdouble))
    anywhere = rng.normal(size=(3, 30, joints))
    structural = base_parameters(regressor(model, *anywhere), base.names)
    fine = tree.columns(*anywhere, precision=np.longdouble)
    nominal = truth * rng.uniform(0.8, 1.2)  # all by one factor: still bodies
    consistent = _consistency(factor.R, base, beta, truth, nominal, joints)
    return Outcome(
        joints, base.rank, exact_rank, structural.rank, exact_identifiability(fine)[0],
        int((base.identifiable & ~exact).sum()), int((exact & ~base.identifiable).sum()),
        int(inside.sum()), len(inside), int(inside[alone].sum()), int(alone.sum()),
        float(base.singular_values[base.rank - 1]),
        float(base.singular_values[base.rank :].max(initial=0.0)), base.tolerance, *consistent,
    )  # fmt: skip


def _consistency(R, base, beta, truth, nominal, joints):
    w = np.zeros(len(truth))
    w[list(base.independent)] = beta
    blocks = [range(10 * j, 10 * j + 10) for j in range(joints)]
    friction = range(10 * joints, 12 * joints)

    def inconsistent(x):
        bodies = joints - int(is_consistent(x[: 10 * joints].reshape(joints, 10)).sum())
        return bodies + int((x[10 * joints :] < 0.0).sum())

    before = float(np.linalg.norm(R @ (w - truth)))
    # Free directions are the reference's, so that what is counted comes from the data.
    free = (
        w
        + base.null
        @ np.linalg.lstsq(base.scale[:, None] * base.null, base.scale * (nominal - w), rcond=None)[
            0
        ]
    )
    try:
        found = project_information(w, R, blocks, nonnegative=friction, reference=nominal)
    except NumericalError:
        return inconsistent(free), None, before, None
    after = float(np.linalg.norm(R @ (found.coefficients - truth)))
    return inconsistent(free), inconsistent(found.coefficients), before, after


def summary(outcomes):
    """Return the counts over all trees."""

    def total(name):
        return int(sum(getattr(x, name) for x in outcomes))

    solved = [x for x in outcomes if x.distance_after is not None]
    share = [x.inside / x.intervals for x in outcomes]
    return {
        'trees': len(outcomes),
        'parameters': 12 * total('joints'),
        'coverage95_base': total('inside') / total('intervals'),
        'coverage95_base_over_trees_std_error': float(np.std(share) / np.sqrt(len(share))),
        'base_parameters': total('intervals'),
        'coverage95_identifiable_alone': total('inside_alone') / max(total('intervals_alone'), 1),
        'identifiable_alone': total('intervals_alone'),
        'unidentifiable_directions': 12 * total('joints') - total('exact_rank'),
        'directions_missed': int(sum(max(x.rank - x.exact_rank, 0) for x in outcomes)),
        'directions_false': int(sum(max(x.exact_rank - x.rank, 0) for x in outcomes)),
        'structural_rank_errors': int(
            sum(x.structural_rank != x.exact_structural_rank for x in outcomes)
        ),
        'flags_missed': total('missed'),
        'flags_false': total('false'),
        'largest_singular_value_of_zero': max(x.largest_zero for x in outcomes),
        'rank_tolerance': [min(x.tolerance for x in outcomes), max(x.tolerance for x in outcomes)],
        'least_singular_value': min(x.least_value for x in outcomes),
        'trees_inconsistent_before': sum(x.inconsistent_before > 0 for x in outcomes),
        'trees_inconsistent_after': sum(x.inconsistent_after > 0 for x in solved),
        'projections_not_converged': len(outcomes) - len(solved),
        'projections_further_from_truth': sum(
            x.distance_after > x.distance_before * (1.0 + 1e-6) for x in solved
        ),
        'median_distance_ratio': float(
            np.median([x.distance_after / x.distance_before for x in solved])
        ),
    }


def main() -> None:
    """Study trees of two to eight joints in turn, and write the result."""
    parser = make_parser(__doc__, 'trees')
    parser.add_argument('--trees', type=int, default=210)
    arguments = parser.parse_args()
    outcomes = []
    for seed in range(arguments.trees):
        outcomes.append(study(seed, 2 + seed % 7))
        x = outcomes[-1]
        if x.missed or x.false or x.rank != x.exact_rank or x.distance_after is None:
            print('tree', seed, x)
    result = {
        'seeds': [0, arguments.trees - 1],
        'all': summary(outcomes),
        'by_joints': {
            k: summary([x for x in outcomes if x.joints == k])
            for k in sorted({x.joints for x in outcomes})
        },
    }
    write_result(arguments.out, result, 'pin', 'clarabel')
    for name, value in result['all'].items():
        print(f'{name:40s}{value}')


if __name__ == '__main__':
    main()
