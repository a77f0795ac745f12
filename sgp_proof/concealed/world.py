"""A world: a robot, what is concealed in it, how it moves and what its sensors show."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgp_proof.concealed import robots
from sgp_ros.errors import NumericalError
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.controllers import ControllerChoice, computed_force, random_multisine
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree_simulator import tree_simulator

_LATENCY_S = 2.5e-4
_STILL, _LONGEST_REST, _LEAST_MOTION = 1e-9, 0.25, 0.3
_FASTEST_HZ = {'rwp': 2.0, 'tree': 1.2, 'pendulum': 1.6}


@dataclass(frozen=True)
class World:
    """A robot with its true and its nominal simulator.

    Attributes:
        family: of the robot.
        bodies: nominal ones.
        errors: of the inertial parameters.
        nominal: simulator of the URDF that is handed out.
        true: simulator of the real robot, without effects.
        bandwidth: of the control [rad/s].
        rate_hz: of sampling and control.
        sensors: in force on the real robot.
        seed: of everything.
    """

    family: str
    bodies: list
    errors: list
    nominal: object
    true: object
    bandwidth: float
    rate_hz: float
    sensors: Sensors
    seed: int

    @property
    def motors(self):
        return [i for i, body in enumerate(self.bodies) if body.is_driven]

    def run(self, region, seconds, number, effects=(), *, is_nominal=False, sensors=None):
        """Return the recording of a motion; the motion depends on seed, region and `number`.

        Raises:
            UnsuitableError: a motion that leaves the range of the robot.
        """
        rng = np.random.default_rng([self.seed, number])
        reference = self._reference(rng, region)
        q, v, _ = reference.at(0.0)
        position, velocity = rng.uniform(-0.5, 0.5, len(self.bodies)), np.zeros(len(self.bodies))
        position[self.motors], velocity[self.motors] = q, v
        simulator = self.nominal if is_nominal else self.true
        control = computed_force(
            self.nominal.mechanism, self.nominal.joints, tuple(self.motors), reference,
            self.bandwidth,
        )  # fmt: skip
        simulator = replace(
            simulator,
            controllers={
                'tracking': ControllerChoice(lambda *_: control, tuple(position), tuple(velocity))
            },
        )
        chosen = [c for c in (effect.chosen() for effect in effects) if c is not None]
        joints = self.nominal.joints
        simulation = make_simulation(
            simulator,
            seed=int(rng.integers(2**31)),
            rate_hz=self.rate_hz,
            effects=chosen,
            sensors=sensors or self.sensors,
            start_ns=1_790_000_000_000_000_000 + (7_200 * number + self.seed % 1000) * 10**9,
            unlisted=[a for effect in effects for a in effect.unlisted(joints)],
        )
        try:
            with np.errstate(all='ignore'):
                recording = simulate(simulation, seconds)
        except (NumericalError, OverflowError) as error:
            raise UnsuitableError(str(error)) from error
        self._check(recording, region)
        self._check_motion(recording, reference)
        return recording

    def _reference(self, rng, region):
        bodies = [self.bodies[i] for i in self.motors]
        span = np.array([body.span for body in bodies]) * rng.uniform(1.1, 1.4, len(bodies))
        centre = rng.uniform(-0.1, 0.1, len(bodies)) * span
        fastest = _FASTEST_HZ.get(self.family, 1.8)
        slowest = 0.3 if self.family == 'rwp' else 0.08
        if region == 'far':
            free = np.array([min(body.limit, 2.3 * body.span) - body.span for body in bodies])
            centre = rng.choice([-1.0, 1.0], len(bodies)) * rng.uniform(0.6, 0.9) * free
            span, fastest = rng.uniform(0.6, 0.85) * span, 1.3 * fastest
        centre = centre + np.array([body.centre for body in bodies])
        return random_multisine(rng, centre, span, lowest_hz=slowest, highest_hz=fastest)

    def _check(self, recording, region):
        q, a = recording.shown_position, recording.true_acceleration
        finite = (
            np.isfinite(q).all() and np.isfinite(a).all() and np.isfinite(recording.command).all()
        )
        if not finite or np.abs(recording.shown_velocity).max() > 600.0:
            raise UnsuitableError('unstable')
        for i, body in enumerate(self.bodies):
            if body.kind != 'continuous' and np.abs(q[:, i]).max() > body.limit:
                raise UnsuitableError(f'{body.joint} leaves its range')
            if body.is_driven:
                limit = 0.98 * body.effort
                clipped = np.abs(recording.command[:, self.motors.index(i)]) > limit
                if clipped.mean() > 0.02:
                    raise UnsuitableError(
                        f'{body.joint} at its limit in {region}: {clipped.mean():.3f}'
                    )

    def _check_motion(self, recording, reference):
        """Refuse a robot that hardly moves."""
        t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
        wanted = np.array([reference.at(x)[0] for x in t[::10]]).std(axis=0)
        moved = recording.shown_position.std(axis=0)
        still = np.mean(np.abs(recording.shown_velocity) < _STILL * (1.0 + moved), axis=0)
        for i, body in enumerate(self.bodies):
            if still[i] > _LONGEST_REST:
                raise UnsuitableError(f'{body.joint} stands still')
            if body.is_driven and moved[i] < _LEAST_MOTION * wanted[self.motors.index(i)]:
                raise UnsuitableError(f'{body.joint} does not follow')


def draw_world(seed, rng, tier, with_errors):
    """Return a world whose motion is that of a robot in use."""
    family, bodies = robots.draw_robot(rng)
    errors, true_bodies = [], bodies
    if with_errors:
        largest = with_errors * rng.uniform(0.3, 1.0)
        true_bodies, errors = robots.wrong(rng, bodies, largest, 1.0 if tier == 'B' else 0.6)
        if not errors:
            raise UnsuitableError('no wrong parameter')
    return make_world(seed, rng, tier, family, bodies, true_bodies, errors)


def make_world(seed, rng, tier, family, bodies, true_bodies, errors):
    """Return a world of given bodies with sensors and control as its tier has them."""
    is_hard = tier == 'B'
    rate_hz = float(
        rng.choice([100.0, 125.0, 200.0, 250.0, 500.0] if is_hard else [125.0, 200.0, 250.0])
    )
    bandwidth = float(
        rng.uniform(2.5, 9.0) if rng.random() < 0.7 or not is_hard else rng.uniform(9.0, 18.0)
    )
    world = World(
        family, bodies, errors, tree_simulator(robots.urdf(family, bodies)), None, bandwidth,
        rate_hz, _sensors(rng, bodies, is_hard, rate_hz), seed,
    )  # fmt: skip
    pilots = [world.run(region, 6.0, 90, is_nominal=True) for region in ('near', 'far')]
    largest = np.max([np.abs(pilot.command).max(axis=0) for pilot in pilots], axis=0)
    efforts = np.full(len(bodies), 1.0)
    efforts[world.motors] = [_rounded(3.0 * x) for x in largest]
    bodies = [replace(b, effort=float(e)) for b, e in zip(bodies, efforts, strict=True)]
    true_bodies = [replace(b, effort=float(e)) for b, e in zip(true_bodies, efforts, strict=True)]
    nominal = tree_simulator(robots.urdf(family, bodies))
    true = tree_simulator(robots.urdf(family, true_bodies))
    return replace(world, bodies=bodies, nominal=nominal, true=true)


def _sensors(rng, bodies, is_hard, rate_hz):
    bits = int(rng.choice([14, 15])) if is_hard else 17
    linear = float(rng.choice([4e-6, 1e-5])) if is_hard else 1e-6
    return Sensors(
        resolution=tuple(linear if b.is_prismatic else 2.0 * np.pi / 2**bits for b in bodies),
        measures_velocity=bool(not is_hard or rng.random() < 0.75),
        jitter_s=float(rng.choice([0.0, 0.12, 0.3])) / rate_hz if is_hard else 0.0,
        measures_effort=bool(rng.random() < 0.35) if is_hard else False,
        command_latency_s=_LATENCY_S,
    )


def _rounded(x):
    return float(f'{x:.2g}')
