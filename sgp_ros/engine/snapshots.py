"""The whole state of an engine as arrays: what a stopped engine needs to go on as if it had not.

Numbers that are learned are arrays; counts, scores and the samples in flight are one JSON text,
in which Python writes every float so that it reads back to the same bits.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.estimator import Estimator
from sgp_ros.engine.event_text import decode, decode_state, encode, encode_state
from sgp_ros.engine.gate import Before, Gate
from sgp_ros.engine.held_commands import CommandHistory
from sgp_ros.engine.hyperparameters import kernel_named
from sgp_ros.engine.prior_knowledge import empty_baseline, empty_regression
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.engine.snapshot_shapes import require_arrays
from sgp_ros.errors import ConfigError
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.model import Model
from sgp_ros.gp.regression import Regression
from sgp_ros.robots.robot import Robot

VERSION = 12
_TRIED = 40
"""Samples that a model must go on for before it is taken."""
_WAITING = ('U', 'F', 'y', 'held')


def take_snapshot(engine: Engine) -> dict[str, np.ndarray]:
    """Return the whole state of an engine as arrays without objects, for `numpy.savez`."""
    estimator = engine.estimator
    arrays = {'json': np.array(json.dumps(_plain(engine)))}
    for i, name in enumerate(_WAITING):
        rows = [row[i] for row in estimator.waiting]
        arrays[f'waiting_{name}'] = np.array(rows) if rows else np.zeros(0)
    if estimator.first_off:
        arrays['waiting_off'] = np.array(estimator.first_off)
    arrays |= {f'complement.{k}': array for k, array in estimator.complement.state().items()}
    for name, regression in _regressions(estimator).items():
        arrays[f'{name}_noise'] = np.array(regression.model.noise)
        for key, array in regression.state().items():
            arrays[f'{name}.{key}'] = array
        for j, kernel in enumerate(regression.model.kernels):
            if kernel is not None:
                arrays[f'{name}_kernel{j}'] = kernel.values
    return arrays


def _plain(engine: Engine) -> dict[str, Any]:
    """Return everything but arrays, as JSON holds it."""
    estimator, intake, order = engine.estimator, engine.intake, engine.order
    return {
        'version': VERSION,
        'robot': engine.robot.name,
        'coefficients': [c.name for c in engine.robot.coefficients],
        'settings': engine.config.to_mapping(),
        'counts': asdict(engine.counts),
        'fits': engine.fits,
        'stale_fits': engine.stale_fits,
        'next_fit': engine.next_fit,
        'progress': engine.progress.state(),
        'delay_s': engine.delay_s,
        'released': None
        if order.released_ns is None
        else [order.released_ns, order.released_rank],
        'newest_ns': order.newest_ns,
        'pending': [encode(event) for event in order.pending],
        'suspects': [encode(event) for event in engine.clock.pending],
        'behind': list(engine.clock.behind),
        'began_ns': engine.began_ns,
        'commands': _held(intake.commands),
        'targets': _held(intake.targets),
        'states': [encode_state(state) for state in engine.filter.windows.states],
        'next_ns': engine.filter.windows.next_ns,
        'trial': None
        if engine.filter.trial is None
        else [None if s is None else encode_state(s) for s in engine.filter.trial.states],
        'last_state_ns': intake.last_state_ns,
        'is_measured': intake.is_measured,
        'repeated': intake.repeated.state(),
        'impossible': intake.limits.impossible,
        'scoring': estimator.scoring.state(),
        'gate': estimator.gate.state(),
        'before': None
        if estimator.before is None
        else [estimator.before.gate.state(), estimator.before.left, estimator.before.errors],
    }


def snapshot_config(snapshot: Mapping[str, np.ndarray], robot: Robot) -> EngineConfig:
    """Return the settings a snapshot was taken with.

    Raises:
        ConfigError: no snapshot, or one of another version or robot.
    """
    text = _text(snapshot)
    if text.get('version') != VERSION:
        raise ConfigError(f'a snapshot of version {text.get("version")!r}', f'version {VERSION}')
    names = [c.name for c in robot.coefficients]
    if text['coefficients'] != names:
        raise ConfigError(
            f'a snapshot of robot {text["robot"]} with parameters {text["coefficients"]}',
            f'robot {robot.name} with parameters {names}',
        )
    if not isinstance(text['settings'], dict):
        raise ConfigError(f'a snapshot with the settings {text["settings"]!r}', 'a mapping')
    return EngineConfig.from_mapping(text['settings'], robot)


def restored(robot: Robot, snapshot: Mapping[str, np.ndarray]) -> Engine:
    """Return an engine that continues exactly where `snapshot` was taken, with its settings.

    Another one goes on for a few samples first: parts that do not fit each other show in use.

    Raises:
        ConfigError: no snapshot, one of another version or robot, or one that cannot be used.
    """
    config = snapshot_config(snapshot, robot)
    tried = Engine(robot, config)
    require_arrays(snapshot, len(robot.joints), tried.estimator.prior.size)
    try:
        with np.errstate(all='ignore'):
            _fill(tried, snapshot)
            _use(tried)
        engine = Engine(robot, config)
        _fill(engine, snapshot)
    except Exception as error:
        said = ' '.join(f'{type(error).__name__}: {error}'.split())[:200]
        raise ConfigError(
            f'a snapshot whose parts do not fit each other ({said})',
            'a model saved by this version',
        ) from error
    return engine


def _use(engine: Engine) -> None:
    """Let an engine that is then thrown away predict, learn and tell what it knows."""
    robot, config = engine.robot, engine.config
    states = engine.filter.windows.states
    start = states[-1].position if states else np.zeros(len(robot.joints))
    begin_ns = max(engine.order.newest_ns or 0, 0)
    engine.begin_stream()
    step_ns = max(round(min(config.filter_window / 8.0, 0.01) * 1e9), 1)
    for i in range(_TRIED):
        x = frozen_array(start + 1e-3 * np.sin(0.7 * i))
        state = JointSample(begin_ns + (i + 1) * step_ns, robot.joint_names, x, effort=x)
        for failure in engine.push(state).failures:
            raise failure.error
    for failure in engine.flush().failures:
        raise failure.error
    for tell in (engine.parameters, engine.scores, engine.hyper_settings,
                 engine.physics_parameters, engine.process_weights):  # fmt: skip
        tell()
    take_snapshot(engine)


def _held(history: CommandHistory) -> list[Any]:
    return [
        [stamp, values.tolist()]
        for stamp, values in zip(history.stamps_ns, history.efforts, strict=True)
    ]


def _fill(engine: Engine, snapshot: Mapping[str, np.ndarray]) -> None:
    """Bring a fresh engine, built with the settings of `snapshot`, to its state."""
    text = _text(snapshot)
    for name, value in text['counts'].items():
        setattr(engine.counts, name, value)
    engine.fits, engine.next_fit = text['fits'], text['next_fit']
    engine.stale_fits = text['stale_fits']
    engine.progress.restore(text['progress'])
    engine.delay_s = text['delay_s']
    intake = engine.intake
    for history, name in ((intake.commands, 'commands'), (intake.targets, 'targets')):
        for stamp, values in text.get(name, ()):
            history.add(stamp, np.array(values))
    engine.filter.windows.states = [decode_state(state) for state in text['states']]
    engine.filter.windows.next_ns = text['next_ns']
    if engine.filter.trial is not None:
        for entry in text['trial']:
            engine.filter.trial.add(None if entry is None else decode_state(entry))
    intake.last_state_ns = text['last_state_ns']
    intake.is_measured = text['is_measured']
    intake.repeated.restore(text['repeated'])
    intake.limits.impossible = text['impossible']
    released = text['released']
    engine.order.resume(
        None if released is None else (released[0], released[1]),
        text['newest_ns'],
        [decode(event) for event in text['pending']],
    )
    engine.clock.pending = [decode(event) for event in text['suspects']]
    count, last_ns = text['behind']
    engine.clock.behind = int(count), int(last_ns)
    engine.began_ns = text['began_ns']
    estimator = engine.estimator
    estimator.scoring.restore(text['scoring'])
    estimator.waiting = list(zip(*(snapshot[f'waiting_{name}'] for name in _WAITING), strict=True))
    estimator.first_off = list(snapshot.get('waiting_off', ()))
    estimator.complement.restore(_part('complement.', snapshot))
    if 'model_noise' in snapshot:
        estimator.regression = _read_regression('model', snapshot, engine)
    if 'baseline_noise' in snapshot:
        estimator.baseline = _read_regression('baseline', snapshot, engine)
    estimator.gate.restore(text['gate'])
    if text['before'] is not None:
        gate = Gate(len(engine.robot.joints))
        gate.restore(text['before'][0])
        model = _read_regression('before_model', snapshot, engine)
        baseline = None
        if 'before_baseline_noise' in snapshot:
            baseline = _read_regression('before_baseline', snapshot, engine)
        estimator.before = Before(model, baseline, gate, *text['before'][1:])


def _regressions(estimator: Estimator) -> dict[str, Regression]:
    found = {'model': estimator.regression, 'baseline': estimator.baseline}
    if estimator.before is not None:
        before = estimator.before
        found |= {'before_model': before.regression, 'before_baseline': before.baseline}
    return {name: regression for name, regression in found.items() if regression is not None}


def _read_regression(name: str, snapshot: Mapping[str, np.ndarray], engine: Engine) -> Regression:
    kernels: list[Kernel | None] = []
    kernel = kernel_named(engine.config.model_kernel)
    for j, columns in enumerate(engine.estimator.inputs):
        key = f'{name}_kernel{j}'
        if key not in snapshot or columns is None:
            kernels.append(None)
            continue
        kernels.append(kernel.of_values(snapshot[key], columns))
    noise = tuple(float(x) for x in snapshot[f'{name}_noise'])
    make = empty_baseline if name.endswith('baseline') else empty_regression
    model = Model(tuple(kernels), noise)
    regression: Regression = make(model, engine.estimator.prior, engine.config)
    regression.restore(_part(f'{name}.', snapshot))
    return regression


def _part(prefix: str, snapshot: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {key.removeprefix(prefix): snapshot[key] for key in snapshot if key.startswith(prefix)}


def _text(snapshot: Mapping[str, np.ndarray]) -> dict[str, Any]:
    if 'json' not in snapshot:
        raise ConfigError(f'a file with {sorted(snapshot)}', 'a model saved by this package')
    try:
        text = json.loads(str(snapshot['json']))
    except (ValueError, RecursionError) as error:
        raise ConfigError('a snapshot without its description', 'a saved model') from error
    if not isinstance(text, dict) or not {'robot', 'coefficients', 'settings'} <= set(text):
        raise ConfigError('a snapshot with another description', 'a saved model')
    return text
