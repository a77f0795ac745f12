"""Section IV.D: a three-link arm, trained on a horizontal figure-eight, tested on a vertical one.

The physics is the rigid-body regressor with viscous and Coulomb friction of constant size. What it
does not know is that the dry friction of joint 3 grows towards its limits.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sgp_proof.columns import Signal, single_column, velocity
from sgp_proof.paper.figure_eight import ARM, ArmRun, FigureEight, follow
from sgp_proof.paper.protocol import Test, World
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.physics.term import Coefficient, Joint, Motion
from sgp_ros.rigid.inertial import inertial_term, revolute_chain
from sgp_ros.robots.robot import Robot

CHANNELS = ('joint1', 'joint2', 'joint3')
SAMPLES, SIZE = 800, 400
"""Samples a run at 100 a second, and how many of those of the training run are learned from."""
TORQUE_NOISE = np.array([0.05, 0.05, 0.02])
"""Standard deviation of the torque sensors [N m]."""
DISTURBANCE = np.array([1.0, 2.5, 0.8])
"""Standard deviation of what shakes the joints; it is part of the torque measured [N m]."""
ACCELERATION_NOISE = 0.02
"""Standard deviation of the measured accelerations [rad/s^2]."""
CANDIDATES = (0, 1, 2, 3, 4, 5, 12, 13, 14)
"""Positions, velocities and directions of motion of all joints. Accelerations are left out: along
one figure-eight they are nearly a function of the positions, so Z could lean on them and fail on
any other curve."""
SMOOTH = (0, 1, 2, 3, 4, 5)
"""The same without directions, as in the paper."""
PRIOR_FACTOR = 1e2


def make_world(seed: int) -> World:
    """Follow one horizontal figure-eight to learn, another one and a vertical one to test.

    Inputs are positions, velocities and accelerations, targets the torques of the three joints.
    The paper gives no dimensions, speeds or noise; those here are a choice.
    """
    train, horizontal, vertical = (_observe(run, seed, i) for i, run in enumerate(_runs(seed)))
    tests = {'horizontal': horizontal, 'vertical': vertical}
    k = len(CHANNELS)
    return World(
        train.data, tests, CHANNELS, (CANDIDATES,) * k, size=SIZE, paper_inputs=(SMOOTH,) * k
    )


def make_prior(world: World) -> CoefficientPrior:
    """Return a weak prior of W: 100 times what would make each column as large as the target.

    Torques determine only some combinations of the 30 inertial parameters. A curve that asks about
    another one would have infinite variance under a flat prior; this one keeps it finite. The
    worlds of `make_world` excite all that their tests ask about: there both score alike.
    """
    squares = (world.train.F**2).mean(axis=(0, 1))
    squares = np.where(squares > 0.0, squares, 1.0)
    std = PRIOR_FACTOR * np.sqrt(world.train.y.var() / squares)
    return CoefficientPrior.from_std(np.zeros(len(std)), std)


def make_robot() -> Robot:
    """Return the inverse model of the arm: 30 inertial, 3 viscous and 3 Coulomb coefficients."""
    tree = revolute_chain(
        CHANNELS, [link.axis for link in ARM.links], [link.offset for link in ARM.links]
    )
    source = 'Wu and Movellan, equation (29)'
    viscous = [
        single_column(Coefficient(f'{name}.viscous', 'N m s/rad', name), j, velocity(j), source)
        for j, name in enumerate(CHANNELS)
    ]
    dry = [
        single_column(Coefficient(f'{name}.coulomb', 'N m', name), j, _direction(j), source)
        for j, name in enumerate(CHANNELS)
    ]
    return Robot(
        name='three_link_arm',
        joints=tuple(Joint(name, direction_width=ARM.width) for name in CHANNELS),
        target='effort',
        terms=(inertial_term(tree, ('link1', 'link2', 'link3')), *viscous, *dry),
        residual_inputs=tuple((f'position:{name}', f'direction:{name}') for name in CHANNELS),
        description='Three-link arm with constant friction, Wu and Movellan, section IV.D',
    )


def _direction(joint: int) -> Signal:
    """Return the sign of the velocity, as smooth as in the truth.

    In the paper model and truth share sign(v). A truth that can be integrated has no jump, and the
    difference of the two would be a second piece of missing physics, on every joint.
    """
    return lambda motion: np.tanh(motion.velocity[:, joint] / ARM.width)


def make_curves(rng: np.random.Generator) -> tuple[FigureEight, ...]:
    """Draw the curve to learn from, a similar one, and one in a vertical plane."""
    return _horizontal(rng), _horizontal(rng), _vertical(rng)


def _horizontal(rng: np.random.Generator) -> FigureEight:
    centre = (rng.uniform(0.48, 0.50), 0.0, rng.uniform(0.24, 0.28))
    return _curve(rng, centre, (rng.uniform(0.14, 0.16), 0.0, 0.0))


def _vertical(rng: np.random.Generator) -> FigureEight:
    centre = (rng.uniform(0.37, 0.39), 0.0, rng.uniform(0.44, 0.48))
    return _curve(rng, centre, (0.0, 0.0, rng.uniform(0.18, 0.22)))


def _curve(
    rng: np.random.Generator,
    centre: tuple[float, float, float],
    across: tuple[float, float, float],
) -> FigureEight:
    return FigureEight(
        centre,
        along=(0.0, rng.uniform(0.28, 0.32), 0.0),
        across=across,
        period=rng.uniform(2.7, 3.3),
        phase=rng.uniform(0.0, 2.0 * np.pi),
        swing=0.12,
        swing_period=rng.uniform(5.0, 7.0),
    )


@lru_cache(maxsize=2)
def _runs(seed: int) -> tuple[ArmRun, ...]:
    """Return the true runs of a seed; kept, as every method asks for the same."""
    rng = np.random.default_rng((seed, 0))
    return follow(make_curves(rng), SAMPLES, DISTURBANCE, rng)


def _observe(run: ArmRun, seed: int, index: int) -> Test:
    rng = np.random.default_rng((seed, 1, index))
    y = run.torque + TORQUE_NOISE * rng.standard_normal(run.torque.shape)
    a = run.acceleration + ACCELERATION_NOISE * rng.standard_normal(run.torque.shape)
    motion = Motion(run.position, run.velocity, a, y)
    robot = make_robot()
    return Test(Observations(robot.inputs(motion), robot.regressor(motion), y), run.torque)
