"""Sections IV.B and IV.C: the reaction wheel, trained hanging down, tested down and upright."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from sgp_proof.paper.protocol import Test, World
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.engine.windows import Equation, WindowFilter
from sgp_ros.gp.model import Observations
from sgp_ros.physics.catalogue import POSITION_FRICTION
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import SimulatedRecording, simulate
from sgp_ros.simulation.sensors import Sensors

STEPS = 1000
RATE_HZ = 100.0
CHANNELS = ('pole', 'wheel')
_TEST_SEEDS = {'pole_down': 1_000_000, 'pole_up': 2_000_000}
_CONTROLLERS = {'pole_down': 'sinusoids', 'pole_up': 'balance'}
PAPER_INPUTS = (0, 1, 2, 3, 7)
"""Both angles, both velocities, the voltage."""
CANDIDATES = (*PAPER_INPUTS, 8, 9)
"""The same and both directions of motion."""
CONCEALED = (f'{POSITION_FRICTION.name}:joint=pole,amplitude=0.02,lo=2.7,hi=3.1,kind=coulomb',)
"""Stand-in for the unknown physics of section IV.C: extra dry friction of the pole near the bottom
of its swing, which none of the ten coefficients describes. No recording of the paper's physical
wheel is public, so this is a simulation and reported as one."""
ENCODER_SETTINGS = {'filter.window': 0.1, 'filter.hop': 0.05, 'reorder_window': 0.0}


def make_world(seed: int, robot: str = 'reaction_wheel_6', effects: tuple[str, ...] = ()) -> World:
    """Differences of true velocities over one step, as the paper's protocol has it.

    Args:
        seed: of training and test motions.
        robot: `reaction_wheel_6` (no viscous friction) or `reaction_wheel` (all ten).
        effects: physics in the truth that is in neither model.
    """
    model = load_robot(robot)
    train = _differences(_record(seed, 'sinusoids', effects, Sensors()), model)
    tests = {
        region: _differences(
            _record(seed + offset, _CONTROLLERS[region], effects, Sensors()), model
        )
        for region, offset in _TEST_SEEDS.items()
    }
    return _world(seed, train, tests, model)


def make_encoder_world(
    seed: int, settings: Mapping[str, float] | None = ENCODER_SETTINGS
) -> World:
    """The same from 12-bit encoder positions.

    Args:
        seed: of training and test motions.
        settings: of the package's own filter; None for differences of positions, paired with the
            command by index.
    """
    model = load_robot('reaction_wheel_6')
    filtered = _index_paired if settings is None else partial(_filtered, settings=settings)
    train = filtered(_record(seed, 'sinusoids', (), None), model)
    tests = {
        region: filtered(_record(seed + offset, _CONTROLLERS[region], (), None), model)
        for region, offset in _TEST_SEEDS.items()
    }
    return _world(seed, train, tests, model)


def _world(seed: int, train: Test, tests: dict[str, Test], model: Robot) -> World:
    return World(
        train.data, tests, CHANNELS, (CANDIDATES, CANDIDATES),
        true_coefficients=_truth(seed, model), paper_inputs=(PAPER_INPUTS, PAPER_INPUTS),
    )  # fmt: skip


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
    motion = Motion(q, v, np.zeros_like(q), effort)
    data = Observations(model.inputs(motion), model.regressor(motion), y)
    return Test(data, recording.true_acceleration[:-1])


def _index_paired(recording: SimulatedRecording, model: Robot) -> Test:
    """Return backward differences of the positions, and of these, beside the command."""
    v = np.diff(recording.position, axis=0) * RATE_HZ
    y = np.diff(v, axis=0) * RATE_HZ
    q, v, m = recording.position[1:-1], v[:-1], recording.command[1:-1, 0]
    motion = Motion(q, v, np.zeros_like(q), np.column_stack([np.zeros_like(m), m]))
    data = Observations(model.inputs(motion), model.regressor(motion), y)
    return Test(data, recording.true_acceleration[1:-1])


def _filtered(recording: SimulatedRecording, model: Robot, settings: Mapping[str, float]) -> Test:
    """Return the equations of the weak form, and the noise-free acceleration in the same form.

    The true motion carries the process noise, so the noise-free acceleration is equation (27) with
    the true coefficients at the true states, averaged like everything else.
    """
    config = EngineConfig.from_mapping(settings, model)
    complete = load_robot('reaction_wheel')
    w = _coefficients(recording.truth, complete)
    U, F, y = [], [], []
    for equation in _equations(recording, recording.position, model, config):
        motion = equation.motion
        U.append(model.inputs(motion)[0])
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
    intake, windows = Intake(model, config, Counts()), WindowFilter(model, config)
    equations = []
    for i, stamp in enumerate(recording.stamps_ns):
        intake.take_command(CommandSample(int(stamp), recording.command[i]))
        sample = JointSample(int(stamp), recording.joint_names, position[i])
        state = intake.take_state(sample)
        equations += windows.push(state, intake.commands) if state is not None else []
    return equations


def _truth(seed: int, model: Robot) -> dict[int, float]:
    values = _coefficients(make_simulation('reaction_wheel', seed=seed).truth(), model)
    return {
        i: float(values[i])
        for i, c in enumerate(model.coefficients)
        if c.name in ('w1', 'w5', 'w9', 'w10')
    }
