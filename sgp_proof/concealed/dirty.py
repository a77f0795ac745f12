"""Worlds of tier C: machines as they stand in works and labs, with six to twelve effects at once.

    python -m sgp_proof.concealed.dirty --seeds 0:8 --out DIR

writes `DIR/cases/case_NNN/{robot.urdf,real.mcap,real_test.mcap}` and `DIR/answers/case_NNN.json`.
There is no simulation to compare with and no command: efforts are measured, with noise and bias.
The seed says what is concealed: most worlds lack all friction, rotors and more, some lack nothing,
some have wrong bodies alone, some have a law outside the list on top.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sgp_proof.concealed import blemishes, machines, production, several
from sgp_proof.concealed.balance import pilot_motion
from sgp_proof.concealed.hidden import draw_hidden, state_friction
from sgp_proof.concealed.robots import urdf, wrong
from sgp_proof.result_files import seed_range
from sgp_ros.errors import NumericalError
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.controllers import ControllerChoice
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree_simulator import tree_simulator

HIDDEN, NOTHING, PARAMETERS, UNLISTED = 'hidden', 'none', 'parameters', 'unlisted'
PLAN = (HIDDEN, HIDDEN, PARAMETERS, HIDDEN, UNLISTED, HIDDEN, NOTHING, HIDDEN)
"""Kind of the concealed defect, by seed."""
_TRIES = 30
_SLOWEST_SERVO_HZ = 250.0
_PILOT_S, _TEST_S = 12.0, 15.0
_FURTHEST = 0.25


@dataclass(frozen=True)
class Machine:
    """A machine and what is handed out about it.

    Attributes:
        family: of the machine.
        bodies: as the robot file states them.
        errors: of the inertial parameters.
        nominal, true: simulators of the robot file, and of the machine without what is concealed.
        gears: of the joints.
        inertia: (k,) that the servos are tuned to [kg m^2 or kg].
        bandwidth: of the servos [rad/s].
        rate_hz: of the recordings.
        kind: of the motion.
        sensors: of the machine.
        seed: of everything.
    """

    family: str
    bodies: list
    errors: list
    nominal: object
    true: object
    gears: list
    inertia: np.ndarray
    bandwidth: float
    rate_hz: float
    kind: str
    sensors: Sensors
    seed: int

    @property
    def every(self):
        """Servo samples a recorded one."""
        return math.ceil(_SLOWEST_SERVO_HZ / self.rate_hz)

    def run(self, seconds, number, effects=()):
        """Return a simulated recording at the rate of the servos.

        Raises:
            UnsuitableError: a motion that the servos do not hold.
        """
        rng = np.random.default_rng([self.seed, number])
        reference = production.plan(rng, self.kind, seconds, self.bodies, self.gears)
        control = production.servo(self.nominal.mechanism, self.inertia, reference, self.bandwidth)
        q, v, _ = reference.at(0.0)
        choice = ControllerChoice(lambda *_: control, tuple(q), tuple(v))
        simulation = make_simulation(
            replace(self.true, controllers={'servo': choice}),
            seed=int(rng.integers(2**31)), rate_hz=self.rate_hz * self.every,
            effects=[x for x in (effect.chosen() for effect in effects) if x is not None],
            unlisted=[a for x in effects for a in x.unlisted(self.nominal.joints)],
            sensors=self.sensors, start_ns=1_790_000_000_000_000_000 + number * 10**13,
        )  # fmt: skip
        try:
            with np.errstate(all='ignore'):
                recording = simulate(simulation, seconds)
        except NumericalError as error:
            raise UnsuitableError(str(error)) from error
        self._check(recording, reference)
        return recording

    def _check(self, recording, reference):
        t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
        wanted = np.array([reference.at(x)[0] for x in t[:: self.every]])
        away = np.abs(recording.true_position[:: self.every] - wanted).max(axis=0)
        span = np.array([body.span for body in self.bodies])
        if not np.isfinite(away).all() or (away > _FURTHEST * span).any():
            raise UnsuitableError(f'joints stray from the plan by {away / span} of their spans')


def draw_world(seed, attempt=0, largest_joints=7):
    """Return a machine, what is concealed in it, its blemishes, and a name for all that."""
    wanted = PLAN[seed % len(PLAN)]
    rng = np.random.default_rng([seed, ord('C'), attempt])
    family, bodies = machines.draw_machine(rng, largest_joints)
    true_bodies, errors = bodies, []
    if wanted == PARAMETERS or (wanted != NOTHING and rng.random() < 0.6):
        true_bodies, errors = wrong(rng, bodies, rng.uniform(0.1, 0.3), 1.0)
    mechanism = tree_simulator(urdf(family, true_bodies)).mechanism
    middle = np.zeros(len(bodies))
    own = np.diag(np.linalg.inv(mechanism.dynamics(middle, middle)[0]))
    gears = machines.draw_gears(rng, bodies, own)
    has_rotors = wanted in {HIDDEN, UNLISTED} and rng.random() < 0.85
    rotors = np.array([gear.inertia for gear in gears]) * has_rotors
    rate = float(rng.choice([50.0, 100.0, 125.0, 250.0, 500.0] if len(bodies) < 5 else
                            [50.0, 100.0, 125.0, 250.0]))  # fmt: skip
    machine = Machine(
        family, bodies, errors, tree_simulator(urdf(family, bodies)),
        tree_simulator(urdf(family, true_bodies)), gears, own + rotors,
        float(rng.uniform(18.0, 30.0)), rate, str(rng.choice(production.KINDS)),
        _sensors(rng, bodies, gears), seed,
    )  # fmt: skip
    pilot = machine.run(_PILOT_S, 90)
    motion = replace(
        pilot_motion(pilot, machine), effort=np.sqrt(np.mean(pilot.effort**2, axis=0))
    )
    if wanted in {HIDDEN, UNLISTED}:
        bodies, effects = draw_hidden(rng, machine, motion, rotors, wanted == UNLISTED)
    else:
        bodies, effects = state_friction(rng, machine, motion), []
    stated = [(b.damping, b.friction) for b in bodies]
    true_bodies = [
        replace(b, damping=d, friction=f)
        for b, (d, f) in zip(true_bodies, stated, strict=True)
    ]  # fmt: skip
    machine = replace(
        machine, bodies=bodies, nominal=tree_simulator(urdf(family, bodies)),
        true=tree_simulator(urdf(family, true_bodies)),
    )  # fmt: skip
    return wanted, machine, effects, blemishes.draw_blemishes(rng, len(bodies), 1.0 / rate), rng


def draw_case(seed, out, seconds=None, largest_joints=7, *, is_one_size=False):
    """Write one world and return a line about it."""
    for attempt in range(_TRIES):
        try:
            return _attempt(seed, attempt, out, seconds, largest_joints, is_one_size)
        except UnsuitableError:  # noqa: PERF203 - tries are few
            continue
    return f'case_{seed:03d}: no suitable world in {_TRIES}'


def _attempt(seed, attempt, out, seconds, largest_joints, is_one_size):
    wanted, machine, effects, spoilt, rng = draw_world(seed, attempt, largest_joints)
    spoilt = replace(spoilt, is_one_size=is_one_size)
    seconds = seconds or float(rng.uniform(24.0, 45.0))
    parts = [
        machine.run(seconds / spoilt.parts, 1 + i, effects) for i in range(spoilt.parts)
    ]  # fmt: skip
    test = machine.run(min(_TEST_S, seconds), 11, effects)
    case = f'case_{seed:03d}'
    folder = out / 'cases' / case
    for path in (folder, out / 'answers'):
        path.mkdir(parents=True, exist_ok=True)
    robot_file = folder / 'robot.urdf'
    robot_file.write_text(urdf(machine.family, machine.bodies), encoding='utf-8')
    _, size, step = blemishes.sizes_of(parts, spoilt)
    noise = (spoilt.effort_noise * size) ** 2 + step**2 / 12.0 if is_one_size else 0.0
    answer = several.answer(wanted, machine, effects, parts, robot_file, noise)
    answer |= {
        'case': case, 'key': f'C_{wanted}_{machine.family}{len(machine.bodies)}_{machine.kind}',
        'rate_hz': machine.rate_hz, 'seconds': seconds, 'blemishes': spoilt.described(),
    }  # fmt: skip
    for name, recordings in (('real', parts), ('real_test', [test])):
        found = blemishes.samples(recordings, machine.every, spoilt, rng)
        blemishes.write_samples(found, folder / f'{name}.mcap', rng)
    path = (out / 'answers' / case).with_suffix('.json')
    path.write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')
    asked = sum(effect['is_asked'] for effect in answer['effects'])
    motion = f'{machine.rate_hz:g} Hz {seconds:.0f} s'
    return f'{case} {answer["key"]} {motion}: {len(effects)} effects, {asked} asked'


def _sensors(rng, bodies, gears):
    """Return encoders of 12 to 20 bits, behind the gears or without."""
    bits = int(rng.integers(12, 21))
    is_geared = bits < 16 or rng.random() < 0.5
    return Sensors(
        resolution=tuple(
            float(rng.choice([1e-6, 5e-6, 1e-5])) if body.is_prismatic
            else 2.0 * np.pi / 2**bits / (gear.ratio if is_geared else 1.0)
            for body, gear in zip(bodies, gears, strict=True)
        ),
        measures_velocity=True, velocity_noise=(0.0,), measures_effort=True,
    )  # fmt: skip


def main():
    """Draw worlds and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:8', help='FIRST:LAST+1')
    parser.add_argument('--out', type=Path, required=True)
    parser.add_argument(
        '--one-size', action='store_true',
        help='noise of all efforts as large as that of the greatest, as of drives of one size',
    )  # fmt: skip
    arguments = parser.parse_args()
    for seed in seed_range(arguments.seeds):
        begin = time.perf_counter()
        line = draw_case(seed, arguments.out, is_one_size=arguments.one_size)
        print(f'{line}  {time.perf_counter() - begin:.1f} s', flush=True)


if __name__ == '__main__':
    main()
