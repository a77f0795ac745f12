"""The paper's own three concealments: worlds drawn, diagnosed and scored.

    python -m sgp_proof.concealed.paper [--seeds 0:10] [--worlds DIR]

A friction irregularity of the pendulum between 2 and 2.5 rad (section I.A), the viscous friction
that the model of the reaction wheel leaves out (IV.B), friction near the limits of joint 3 of the
arm (IV.D). Every seed is a world of each, with sensors and control as in the other worlds, seeds
in turn of tier A and B, and friction of another size: as in `sgp reproduce`, doubled, or a part of
it. Results go to `sgp_proof/results/concealed_paper.json`.

Two things are other than in the paper. Pendulum and arm are driven by tracking, for the held-out
recordings need another region. The positions of joint 3 are counted from the middle of its range,
and the arm has no constant dry friction, of which a URDF says nothing.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from sgp_proof.concealed import draw, sizes
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.concealed_effect import Concealed
from sgp_proof.concealed.robots import DOWN, UP, Body, Y, Z
from sgp_proof.concealed.run import scored_case
from sgp_proof.concealed.scoring import summary
from sgp_proof.paper import toy
from sgp_proof.paper.figure_eight import ARM
from sgp_proof.result_files import make_parser, seed_range, write_result
from sgp_ros.physics.catalogue import LIMIT_FRICTION, POSITION_FRICTION, VISCOUS_FRICTION
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.simulation.reaction_wheel import ReactionWheel
from sgp_ros.simulation.toy_pendulum import ToyPendulum

SIZES = (1.0, 0.5, 2.0, 0.25, 0.125)
"""Friction relative to that of `sgp reproduce`, in turn."""
_TRIES = 8
BALL = 0.04
"""Moment of inertia about its centre of what the paper takes for a point [kg m^2]."""


def main():
    parser = make_parser(__doc__, 'concealed_paper')
    parser.add_argument('--seeds', default='0:10', help='FIRST:LAST+1')
    parser.add_argument('--worlds', type=Path, help='where the worlds are kept')
    arguments = parser.parse_args()
    rows = {name: [] for name in CONCEALMENTS}
    with tempfile.TemporaryDirectory() as folder:
        out = arguments.worlds or Path(folder) / 'worlds'
        for part in ('cases', 'answers'):
            (out / part).mkdir(parents=True, exist_ok=True)
        for seed in seed_range(arguments.seeds):
            for name in CONCEALMENTS:
                drawn = draw_paper_case(seed, name, out)
                if drawn is not None:
                    row = scored_case(out, drawn[0], Path(folder) / 'out' / drawn[0])
                    rows[name].append(with_shares(row, size_of(seed), drawn[1]))
    report = {
        'seeds': arguments.seeds,
        'concealments': {
            name: {'summary': summary(found), 'cases': found} for name, found in rows.items()
        },
    }  # fmt: skip
    write_result(arguments.out, report)


def size_of(seed):
    """Return the size of the friction relative to that of `sgp reproduce`."""
    return SIZES[(seed // 2) % len(SIZES)]


def with_shares(row, size, shares):
    """Return the row of a case with what counts as physics in it and how much of that is named."""
    found = Counter(tuple(entry[:2]) for entry in row['found'])
    truth = Counter(map(tuple, row['truth']))
    count = Counter(
        tuple(x)
        for x, share in zip(row['truth'], shares, strict=True)
        if share >= sizes.SMALLEST_SHARE
    )
    return row | {
        'relative_size': size,
        'shares': [round(x, 5) for x in shares],
        'counting': sum(count.values()),
        'counting_found': sum((found & count).values()),
        'spurious': sum((found - truth).values()),
    }


def draw_paper_case(seed, name, out):
    """Write one world whose friction counts as physics on one joint at least.

    Returns:
        Its name and the share of each effect; None where no motion shows enough.
    """
    number = len(CONCEALMENTS) * seed + list(CONCEALMENTS).index(name)
    tier = 'AB'[seed % 2]
    for attempt in range(_TRIES):
        rng = np.random.default_rng([number, attempt])
        family, bodies, effects = CONCEALMENTS[name](size_of(seed))
        try:
            drawn = 100 * number + attempt
            world = worlds.make_world(drawn, rng, tier, family, bodies, bodies, errors=[])
            world, motion, relative = draw.observed(rng, world, tier)
            runs = draw.run_all(world, effects)
            shares = draw.own_shares(runs['real'], world, effects)
            if max(shares) < sizes.SMALLEST_SHARE:
                raise UnsuitableError(f'shares {shares}')  # noqa: TRY301 - as those of the runs
        except UnsuitableError as problem:
            print(f'  {name}, seed {seed}: {problem}', file=sys.stderr)
            continue
        draw.write_case(number, tier, name, out, rng, world, effects, runs, motion, relative)
        return f'case_{number:03d}', shares
    return None


def pendulum(scale):
    """Return the toy pendulum with its bump; the angle is zero upright."""
    truth = ToyPendulum()
    body = _body('hinge', UP, truth.mass, truth.length, BALL * np.eye(3),
                 centre=0.5 * sum(toy.DENSE), span=1.4)  # fmt: skip
    lo, hi = toy.BUMP_FROM, toy.BUMP_TO
    place = {'joint': 'hinge', 'variables': ['position'], 'intervals': {'position': [[lo, hi]]}}

    def values(size):
        return {'amplitude': size, 'lo': lo, 'hi': hi, 'kind': 'coulomb'}

    size = scale * truth.friction_amplitude
    return 'pendulum', [body], [
        Concealed.of(POSITION_FRICTION, 'hinge', 0, values, size, location=place)
    ]  # fmt: skip


def wheel(scale):
    """Return the reaction wheel without viscous friction in the model; zero is hanging.

    The back-EMF acts as viscous friction and is part of the same columns of the paper's model.
    """
    truth = ReactionWheel()
    rod = np.diag([1.0, 1.0, 1e-3]) * truth.pole_mass * truth.pole_length**2 / 12.0
    pole = _body('pole', DOWN, truth.pole_mass, 0.5 * truth.pole_length, rod, is_driven=False,
                 tip=truth.pole_length * np.array(DOWN))  # fmt: skip
    disc = np.diag([0.55, 1.0, 0.55]) * truth.wheel_inertia
    rotor = _body('wheel', DOWN, truth.wheel_mass, 0.0, disc, parent=0, span=10.0,
                  xyz=tuple(pole.tip))  # fmt: skip
    motor = truth.torque_constant * truth.back_emf_constant / truth.resistance
    levels = (truth.pole_viscosity, truth.wheel_viscosity + motor)
    return 'rwp', [pole, rotor], [
        Concealed.of(
            VISCOUS_FRICTION, body.joint, i, lambda size: {'b': size}, scale * levels[i]
        )
        for i, body in enumerate((pole, rotor))
    ]  # fmt: skip


def arm(scale):
    """Return the three-link arm with dry friction that rises towards both limits of joint 3."""
    bodies = []
    friction = ARM.frictions[2]
    middle = 0.5 * (friction.lower + friction.upper)
    limit = 0.5 * (friction.upper - friction.lower)
    for i, (link, own) in enumerate(zip(ARM.links, ARM.frictions, strict=True)):
        last = i == len(ARM.links) - 1
        bodies.append(Body(
            f'joint{i + 1}', f'link{i + 1}', 'revolute', (Z, Y, Y)[i], tuple(link.offset),
            (0.0, middle, 0.0) if last else (0.0, 0.0, 0.0), i - 1, link.mass,
            np.array(link.centre), link.tensor, np.array([0.35, 0.0, 0.0]), own.viscous,
            limit if last else 2.6, 0.6 if last else 0.9,
        ))  # fmt: skip
    onset = limit - friction.onset
    return 'arm3', bodies, [
        Concealed.of(
            LIMIT_FRICTION, 'joint3', 2, lambda size, x=side * onset: {'amplitude': size,
                                                                       'onset': x},
            scale * friction.growth,
        )
        for side in (1.0, -1.0)
    ]  # fmt: skip


CONCEALMENTS = {'pendulum': pendulum, 'wheel': wheel, 'arm': arm}
"""Name to family, bodies and concealed effects as a function of the size of the friction."""


def _body(joint, along, mass, distance, tensor, **other):
    values = {
        'kind': 'continuous', 'axis': Y, 'xyz': (0, 0, 1), 'rpy': (0, 0, 0), 'parent': -1,
        'tip': distance * np.array(along), 'damping': 0.0, 'limit': 3.0, 'span': 1.0,
    } | other  # fmt: skip
    return Body(joint, f'{joint}_link', mass=mass, com=distance * np.array(along),
                inertia=tensor, **values)  # fmt: skip


if __name__ == '__main__':
    main()
