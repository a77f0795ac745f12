"""Rest of the double pendulums' efforts after bodies, rotors, dry and viscous friction.

    python -m sgp_proof.real.double_pendulum_rest

The rest is compared with the inertial forces that it is the small difference of. Then families of
further columns are added, each fitted to all runs but one and scored on that one: a law of the
machine would predict runs that it was not fitted to, noise does not.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from sgp_proof.real.diagnosis import MACHINES, execute, inside
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.apps.recorded import read_events
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.open_bodies import open_bodies, with_open_bodies
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.report.metrics import versions
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

DESIGNS = {
    'A.0': ('double_pendulum', 'double_pendulum_a0.urdf'),
    'C.0': ('double_pendulum_c0', 'double_pendulum_c0.urdf'),
}
"""Machine of `MACHINES`, from whose runs a diagnosis learns, and its nominal robot."""
KNOWN = ('dry friction', 'viscous friction', 'rotor')
FAMILIES = (
    'constant load', 'stiffness', 'quadratic drag', 'friction that grows with the load',
    'friction of the sum of both speeds', 'friction of the other joint', 'cogging, 1 to 8',
    'gain of the other effort', 'rotor of the other joint', 'late effort', 'late position',
    'elastic joint', 'products of velocities', 'gravity',
)  # fmt: skip
_ROUNDS = 4
_HARMONICS = (1, 2, 3, 4, 6, 8)


def columns(family, motion, j):
    """Return the forces of a family at joint j, each (n,), up to their sizes."""
    q, v, a, u = motion.position, motion.velocity, motion.acceleration, motion.effort
    other, gross = 1 - j, motion.nominal_effort[:, j]

    def rate(x):
        return np.gradient(x, motion.step, axis=0)

    both = v.sum(axis=1)
    angles = q[:, 0], q.sum(axis=1)
    found = {
        'dry friction': lambda: [np.sign(v[:, j])],
        'viscous friction': lambda: [v[:, j]],
        'rotor': lambda: [a[:, j]],
        'constant load': lambda: [np.ones(len(q))],
        'stiffness': lambda: [q[:, j]],
        'quadratic drag': lambda: [v[:, j] * np.abs(v[:, j])],
        'friction that grows with the load': lambda: [np.abs(u[:, j]) * np.sign(v[:, j])],
        'friction of the sum of both speeds': lambda: [np.sign(both), both],
        'friction of the other joint': lambda: [np.sign(v[:, other]), v[:, other]],
        'cogging, 1 to 8': lambda: [f(m * q[:, j]) for m in _HARMONICS for f in (np.sin, np.cos)],
        'gain of the other effort': lambda: [u[:, other]],
        'rotor of the other joint': lambda: [a[:, other]],
        'late effort': lambda: [rate(u[:, j])],
        'late position': lambda: [rate(gross), rate(a)[:, 0], rate(a)[:, 1]],
        'elastic joint': lambda: [rate(rate(gross)), rate(rate(a))[:, j]],
        'products of velocities': lambda: [v[:, 0] ** 2, v[:, 1] ** 2, v[:, 0] * v[:, 1]],
        'gravity': lambda: [f(x) for x in angles for f in (np.sin, np.cos)],
    }
    return found[family]()


def fit(y, X, bodies, sigma):
    """Return the coefficients (p + c,) of columns X (N, k, p + c), p of bodies of unit variance.

    Args:
        y: (N, k).
        X: columns of the bodies first.
        bodies: p.
        sigma: (k,) standard deviation of what is left.
    """
    unit = np.sqrt((X**2).mean(axis=(0, 1)))
    unit[(np.arange(len(unit)) < bodies) | (unit == 0.0)] = 1.0
    A, b = X / unit / sigma[:, None], y / sigma
    G = np.tensordot(A, A, ((0, 1), (0, 1)))
    G += np.diag((np.arange(len(G)) < bodies).astype(float))
    return np.linalg.lstsq(G, np.tensordot(A, b, ((0, 1), (0, 1))), rcond=1e-13)[0] / unit


def left(y, bodies, extra, run):
    """Return what a fit leaves in mean squares, of all rows and of runs left out, and the fit.

    Least squares weighted by what is left of each joint, with bodies of unit variance.

    Args:
        y: (N, k).
        bodies: (N, k, p).
        extra: (N, k, c).
        run: (N,) labels.

    Returns:
        (k,), (k,) and (p + c,).
    """
    X, p = np.concatenate([bodies, extra], axis=2), bodies.shape[2]
    sigma = y.std(axis=0)
    for _ in range(_ROUNDS):
        coefficients = fit(y, X, p, sigma)
        learned = ((y - X @ coefficients) ** 2).mean(axis=0)
        sigma = np.sqrt(learned)
    outside = np.zeros(y.shape)
    for r in np.unique(run):
        out = run == r
        outside[out] = (y[out] - X[out] @ fit(y[~out], X[~out], p, sigma)) ** 2
    return learned, outside.mean(axis=0), coefficients


def measured(design):
    """Return the size of the rest of a design, and what families of columns leave of it."""
    machine, robot = DESIGNS[design]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with inside(folder):
            for command in MACHINES[machine][:-1]:  # all but the diagnosis
                execute(command, folder)
            nominal = nominal_model(load_robot(f'config/robots/{robot}'))
            events = list(read_events('out/learn.mcap', None, None, []))
    raw = collect(events, nominal.robot, nominal.stated)
    unstated = open_bodies(nominal.robot.name, nominal.tree)
    tree = with_open_bodies(raw, nominal.tree, unstated)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree), unstated)
    motion, low = equations.motion, equations.filter
    run = np.searchsorted([s.stop for s in low.segments], low.rows, side='right')

    def extra(families):
        found = []
        for family in families:
            for j in range(tree.size):
                for x in columns(family, motion, j):
                    column = np.zeros((len(equations.d), tree.size))
                    column[:, j] = low(x)
                    found.append(column)
        return np.stack(found, axis=2)

    def shares(families):
        learned, left_out, found = left(equations.d, equations.base, extra(families), run)
        power, w = equations.power, found[: equations.size]
        return {'learned': learned / power, 'left_out': left_out / power}, w

    known, w = shares(KNOWN)
    parameters = tree.parameters + (w @ equations.directions).reshape(tree.parameters.shape)
    inertia = np.diagonal(mass_matrix(tree, parameters, motion.position), 0, 1, 2)
    inertial = (low(inertia * motion.acceleration) ** 2).mean(axis=0)
    return {
        'rows': len(equations.d), 'runs': len(low.segments), 'cutoff_hz': low.cutoff,
        'joints': tree.joint_names,
        'refused': {k: n for k, n in raw.refused.items() if n},
        'effort_rms': np.sqrt(equations.power), 'inertial_rms': np.sqrt(inertial),
        'rest_rms': np.sqrt(known['learned'] * equations.power),
        'known': known, 'families': {f: shares((*KNOWN, f))[0] for f in FAMILIES},
    }  # fmt: skip


def plain(x):
    """Return a result with lists in the place of arrays."""
    if isinstance(x, dict):
        return {key: plain(value) for key, value in x.items()}
    return np.asarray(x).tolist() if isinstance(x, np.ndarray | tuple) else x


def main():
    """Measure both designs and write what was found."""
    arguments = make_parser(__doc__, 'double_pendulum_rest').parse_args()
    designs = {design: plain(measured(design)) for design in DESIGNS}
    write_result(arguments.out, {
        'command': 'python -m sgp_proof.real.double_pendulum_rest', 'versions': versions(),
        'designs': designs,
    })  # fmt: skip
    for design, found in designs.items():
        print(design, found['rows'], 'rows, rms of effort, inertial force, rest:',
              found['effort_rms'], found['inertial_rms'], found['rest_rms'])  # fmt: skip
        for family, share in {'known': found['known'], **found['families']}.items():
            print('  ', family, *(f'{name} {np.round(x, 4)}' for name, x in share.items()))


if __name__ == '__main__':
    main()
