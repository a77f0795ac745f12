"""Simulations built from names, texts and numbers, with everything checked on the way."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.simulation.effect_text import parse_effect
from sgp_ros.simulation.effects import Action
from sgp_ros.simulation.mechanism import with_physical
from sgp_ros.simulation.registry import SIMULATORS
from sgp_ros.simulation.scenario import Scenario, effect_actions, with_effects
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.stepping import Simulation

_LOWEST_RATE_HZ, _HIGHEST_RATE_HZ = 0.1, 1e5


def make_simulation(
    robot: str | Simulator,
    *,
    seed: int = 0,
    rate_hz: float | None = None,
    controller: str | None = None,
    effects: Iterable[str | EffectAt] = (),
    sensors: Sensors | None = None,
    physical: Mapping[str, float] | None = None,
    torque_noise: Sequence[float] | None = None,
    position: Sequence[float] | None = None,
    velocity: Sequence[float] | None = None,
    start_ns: int = 0,
    unlisted: Iterable[Action] = (),
) -> Simulation:
    """Return a simulation at its start; what is None is as usual for the robot.

    Args:
        robot: a name in `SIMULATORS`, or a simulator.
        seed: of all random numbers, at least 0.
        rate_hz: of sampling and control [Hz].
        controller: a name among the robot's controllers.
        effects: values, or texts such as `coulomb_friction:joint=pole,level=0.01`.
        sensors: what the sensors make of the true state.
        physical: physical parameters that differ, by name [SI].
        torque_noise: (k,) density of the white force on each joint [N m s^0.5 or N s^0.5].
        position: (k,) at the start [rad or m].
        velocity: (k,) at the start [rad/s or m/s].
        start_ns: stamp of the first sample [ns].
        unlisted: what acts beside the effects that have a name.

    Raises:
        ConfigError: what does not exist for this robot or has an impossible value.
    """
    simulator = robot if isinstance(robot, Simulator) else find_simulator(robot)
    name = next(iter(simulator.controllers)) if controller is None else controller
    if name not in simulator.controllers:
        raise ConfigError(
            f'robot {simulator.name} has no controller {name!r}',
            f'one of {list(simulator.controllers)}',
        )
    rate = simulator.rate_hz if rate_hz is None else rate_hz
    if not _LOWEST_RATE_HZ <= rate <= _HIGHEST_RATE_HZ:
        raise ConfigError(f'rate {rate:g} Hz', f'{_LOWEST_RATE_HZ:g} to {_HIGHEST_RATE_HZ:g} Hz')
    if seed < 0:
        raise ConfigError(f'seed {seed}', 'an integer of at least 0')
    chosen = tuple(parse_effect(e) if isinstance(e, str) else e for e in effects)
    for effect in chosen:
        effect_actions(simulator, effect)
    start = simulator.controllers[name]
    scenario = Scenario(
        simulator=simulator,
        mechanism=with_effects(with_physical(simulator.mechanism, physical or {}), chosen),
        effects=chosen,
        sensors=(sensors or simulator.sensors).checked(len(simulator.joints), 1.0 / rate),
        controller=name,
        seed=seed,
        period_ns=round(1e9 / rate),
        start_ns=start_ns,
        torque_noise=_per_joint(simulator, 'torque_noise', torque_noise, simulator.torque_noise),
        position=_per_joint(simulator, 'position', position, start.position),
        velocity=_per_joint(simulator, 'velocity', velocity, start.velocity),
        unlisted=tuple(unlisted),
    )
    return Simulation(scenario)


def find_simulator(name: str) -> Simulator:
    """Return a built-in simulator.

    Raises:
        ConfigError: an unknown name.
    """
    if name not in SIMULATORS:
        raise ConfigError(f'no simulated robot {name!r}', f'one of {list(SIMULATORS)} or a .urdf')
    return SIMULATORS[name]


def _per_joint(
    simulator: Simulator, name: str, given: Sequence[float] | None, usual: tuple[float, ...]
) -> tuple[float, ...]:
    values = usual if given is None else tuple(float(x) for x in given)
    k = len(simulator.joints)
    lowest = 0.0 if name == 'torque_noise' else -math.inf
    if len(values) != k or not all(math.isfinite(x) and x >= lowest for x in values):
        raise ConfigError(
            f'{name} = {list(values)} for robot {simulator.name}',
            f'{k} finite numbers in the order {list(simulator.joint_names)}',
        )
    return values
