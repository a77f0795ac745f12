"""Sections IV.B and IV.C: the reaction wheel, trained hanging down, tested down and upright."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.model import Observations
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.experiments.reproduction.protocol import Test, World
from sgp_ros.robots.registry import ROBOTS
from sgp_ros.robots.robot import Motion
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors

if TYPE_CHECKING:
    from sgp_ros.engine.windows import Equation
    from sgp_ros.robots.robot import Robot
    from sgp_ros.simulation.recording import SimulatedRecording

STEPS = 1000
RATE_HZ = 100.0
CHANNELS = ('pole', 'wheel')
_TEST_SEEDS = {'pole_down': 1_000_000, 'pole_up': 2_000_000}
_CONTROLLERS = {'pole_down': 'sinusoids', 'pole_up': 'balance'}
_INPUTS = (0, 1, 2, 3, 4)
"""Both angles, both velocities, the voltage."""
CONCEALED = ('position_friction:joint=pole,amplitude=0.02,lo=2.7,hi=3.1,kind=coulomb',)
"""What stands for the unknown physics of section IV.C: extra dry friction of the pole near the
bottom of its swing, which is none of the ten coefficients. No recording of the paper's physical
wheel is public, so this is a simulation and told as one."""
ENCODER_SETTINGS = {'filter.window': 0.1, 'filter.hop': 0.05, 'reorder_window': 0.0}


def make_world(seed: int, robot: str = 'reaction_wheel_6', effects: tuple[str, ...] = ()) -> World:
    """Differences of true velocities over one step, as the paper's protocol has it.

    Args:
        seed: of training and test motions.
        robot: `reaction_wheel_6` (no viscous friction) or `reaction_wheel` (all ten).
        effects: physics in the truth that is in neither model.
    """
    model = ROBOTS[robot]
    train = _differences(_record(seed, 'sinusoids', effects, Sensors()), model)
    tests = {
        region: _differences(
            _record(seed + offset, _CONTROLLERS[region], effects, Sensors()), model
        )
        for region, offset in _TEST_SEEDS.items()
    }
    return World(
        train.data, tests, CHANNELS, (_INPUTS, _INPUTS), true_coefficients=_truth(seed, model)
    )


def make_encoder_world(seed: int, robot: str = 'reaction_wheel_6') -> World:
    """The same from 12-bit encoder positions, through the package's own filter."""
    model = ROBOTS[robot]
    train = _filtered(_record(seed, 'sinusoids', (), None), model)
    tests = {
        region: _filtered(_record(seed + offset, _CONTROLLERS[region], (), None), model)
        for region, offset in _TEST_SEEDS.items()
    }
    return World(
        train.data, tests, CHANNELS, (_INPUTS, _INPUTS), true_coefficients=_truth(seed, model)
    )


def _record(
    seed: int, controller: str, effects: tuple[str, ...], sensors: Sensors | None
) -> SimulatedRecording:
    simulation = make_simulation(
        'reaction_wheel', seed=seed, controller=controller, effects=effects, sensors=sensors,
        rate_hz=RATE_HZ, start_ns=1,
    )  # fmt: skip
    return simulate(simulation, (STEPS + 1) / RATE_HZ)


def _differences(recording: SimulatedRecording, model: Robot) -> Test:
    q, v = recording.true_position[:-1], recording.true_velocity[:-1]
    m = recording.command[:-1, 0]
    y = np.diff(recording.true_velocity, axis=0) * RATE_HZ
    effort = np.column_stack([np.zeros_like(m), m])
    F = model.regressor(Motion(q, v, np.zeros_like(q), effort))
    data = Observations(np.column_stack([q, v, m]), F, y)
    return Test(data, recording.true_acceleration[:-1])


def _filtered(recording: SimulatedRecording, model: Robot) -> Test:
    """Return the equations of the weak form, and the noise-free acceleration in the same form.

    The true motion carries the process noise, so the noise-free acceleration is equation (27) with
    the true coefficients at the true states, averaged like everything else.
    """
    config = EngineConfig.from_mapping(ENCODER_SETTINGS, model)
    complete = ROBOTS['reaction_wheel']
    w = _coefficients(recording.truth, complete)
    U, F, y = [], [], []
    for equation in _equations(recording, recording.position, model, config):
        motion = equation.motion
        U.append(np.concatenate([motion.position[0], motion.velocity[0], motion.effort[0, 1:]]))
        F.append(equation.regressor(motion.effort[0, 1:]))
        y.append(motion.acceleration[0])
    truth = [
        equation.regressor(equation.motion.effort[0, 1:]) @ w
        for equation in _equations(recording, recording.true_position, complete, config)
    ]
    return Test(Observations(np.array(U), np.array(F), np.array(y)), np.array(truth))


def _coefficients(truth: dict[str, object], model: Robot) -> np.ndarray:
    found = truth['coefficients']
    assert isinstance(found, dict)
    return np.array([float(found[c.name]['value']) for c in model.coefficients])


def _equations(
    recording: SimulatedRecording, position: np.ndarray, model: Robot, config: EngineConfig
) -> list[Equation]:
    intake = Intake(model, config, Counts())
    equations = []
    for i, stamp in enumerate(recording.stamps_ns):
        intake.take_command(CommandSample(int(stamp), recording.command[i]))
        sample = JointSample(int(stamp), recording.joint_names, position[i])
        equations += intake.take_state(sample)
    return equations


def _truth(seed: int, model: Robot) -> dict[int, float]:
    values = _coefficients(make_simulation('reaction_wheel', seed=seed).truth(), model)
    return {
        i: float(values[i])
        for i, c in enumerate(model.coefficients)
        if c.name in ('w1', 'w5', 'w9', 'w10')
    }
