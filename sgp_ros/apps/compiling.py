"""`sgp compile`: calls every compiled loop of a stream once, so that no command has to wait later.

Numba compiles a function when it is called with types it has not seen, and keeps the result in a
cache beside the source, or in `NUMBA_CACHE_DIR`. A few drawn samples are enough to have what
replay, node and the roll-outs of a diagnosis call.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import fit
from sgp_ros.engine.samples import CommandSample, Event, JointSample, frozen_array
from sgp_ros.rigid.rigid_body import inverse_dynamics, mass_matrix
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

_STREAMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ('reaction_wheel', {}),
    ('panda', {'buffer.policy': 'least_informative'}),
    ('panda', {'buffer.mode': 'basis'}),
)
"""Robots, one commanded and one with coefficients that no motion tells apart, and settings."""
_SETTINGS = {
    'learning.initial': 12, 'buffer.budget': 20, 'basis.features': 10, 'filter.window': 0.05,
    'filter.hop': 0.01, 'refit.enabled': False,
}  # fmt: skip
_STATES, _STEP_NS = 60, 10_000_000


def run_compile(out: Path | None, progress: Callable[[float], None]) -> dict[str, Any]:  # noqa: ARG001 - it writes nothing
    """Compile, or find in the cache, what commands and nodes call.

    Args:
        out: of every command; not used.
        progress: called with the share that is done.
    """
    began = time.process_time()
    for i, (name, settings) in enumerate(_STREAMS):
        _learn(load_robot(name), {**_SETTINGS, **settings})
        progress((i + 1) / (len(_STREAMS) + 1))
    tree = nominal_model(load_robot('panda')).tree
    still = np.zeros((1, tree.size))
    inverse_dynamics(tree, tree.parameters, still, still, still)
    mass_matrix(tree, tree.parameters, still)
    progress(1.0)
    loops = {f'{loop.py_func.__module__}.{loop.__name__}': loop for loop in _loops()}
    called = {name: loop.stats for name, loop in loops.items() if loop.signatures}
    compiled = [name for name, stats in called.items() if stats.cache_misses]
    folders = sorted({str(stats.cache_path) for stats in called.values()})
    seconds = time.process_time() - began
    print(f'{len(compiled)} loops compiled, {len(called) - len(compiled)} found in the cache: '
          f'{seconds:.1f} s')  # fmt: skip
    for folder in folders:
        print(f'cache: {folder}')
    print('next: See the package at work:\n  sgp demo')
    return {
        'compiled': compiled, 'cached': sorted(set(called) - set(compiled)), 'seconds': seconds,
        'folders': folders,
    }  # fmt: skip


def _learn(robot: Robot, settings: dict[str, Any]) -> None:
    """Fold drawn states until samples leave the buffer, then fit the hyper-parameters once."""
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    for event in _events(robot):
        engine.push(event)
    engine.flush()
    regression = engine.estimator.regression
    if regression is not None and len(robot.joints) <= 2:  # of more, a fit takes seconds
        engine.request_refit()
        request = engine.take_fit_request()
        if request is not None:
            fit(request)


def _events(robot: Robot) -> Iterator[Event]:
    rng, k = np.random.default_rng(0), len(robot.joints)
    rates, phases = rng.uniform(2.0, 12.0, k), rng.uniform(0.0, 6.0, k)
    actuated = sum(joint.is_actuated for joint in robot.joints)
    for i in range(_STATES):
        stamp, t = 10**9 + i * _STEP_NS, 1e-9 * i * _STEP_NS
        angle, noise = rates * t + phases, 1e-4 * rng.normal(size=k)
        yield CommandSample(stamp, frozen_array(np.sin(angle[:actuated])))
        yield JointSample(
            stamp, robot.joint_names, frozen_array(0.3 * np.sin(angle) + noise),
            frozen_array(0.3 * rates * np.cos(angle)),
            None if robot.target == 'acceleration' else frozen_array(np.sin(2.0 * angle)),
        )  # fmt: skip


def _loops() -> Iterator[Any]:
    """Yield the compiled functions of the package that are loaded, nothing else has `py_func`."""
    modules = [m for name, m in sys.modules.items() if name.startswith('sgp_ros.')]
    found = {id(x): x for m in modules for x in vars(m).values() if hasattr(x, 'py_func')}
    yield from found.values()
