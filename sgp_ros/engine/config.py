"""Every setting of the engine, with its type, unit, range and default.

A setting has a dotted name, as in a ROS 2 parameter file (`filter.window`). The node declares its
parameters from `describe_settings`, the commands read the same names from the same file, and both
end in one frozen `EngineConfig`. Hyper-parameters are settings too (`engine/hyperparameters.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from sgp_ros.engine.hyperparameters import JointHyperparameters, describe, kernel_named
from sgp_ros.engine.samples import SettingValue
from sgp_ros.engine.setting import Setting
from sgp_ros.errors import ConfigError
from sgp_ros.gp.kernels import KERNELS, SquaredExponential
from sgp_ros.robots.robot import Robot

AUTOMATIC = -1.0
"""Value of `filter.window` that has the first seconds choose it."""


def _setting(
    name: str,
    kind: str,
    default: SettingValue,
    description: str,
    **limits: Any,
) -> Any:
    meta = {'setting': Setting(name, kind, default, description, **limits)}
    return field(default=default, metadata=meta)


@dataclass(frozen=True, slots=True)
class EngineConfig:
    """All settings of the engine. Build it with `from_mapping`."""

    reorder_window: float = _setting(
        'reorder_window', 'float', 0.1, 'Time for which samples wait to be sorted by stamp.',
        unit='s', low=0.0, high=10.0,
    )  # fmt: skip
    max_gap: float = _setting(
        'max_gap', 'float', 0.25, 'Longest pause between states that does not restart the filter.',
        unit='s', low=1e-3, high=60.0,
    )  # fmt: skip
    command_timeout: float = _setting(
        'command.timeout', 'float', 1.0, 'Age beyond which a command is no longer used.',
        unit='s', low=1e-3, high=3600.0,
    )  # fmt: skip
    command_joints: tuple[str, ...] = _setting(
        'command.joints', 'str_array', ('',),
        "Joints of a command array, in its order; ['']: the actuated joints of the robot.",
        read_only=True,
    )  # fmt: skip
    effort_source: str = _setting(
        'effort.source', 'str', 'auto',
        'Source of the effort; auto: measured if the joint states have it, else the commands.',
        choices=('auto', 'state', 'command'),
    )  # fmt: skip
    filter_window: float = _setting(
        'filter.window', 'float', 0.1,
        'Window of differentiation; the delay is half of it. -1: choose from the first seconds.',
        unit='s', low=-1.0, high=10.0,
    )  # fmt: skip
    filter_degree: int = _setting(
        'filter.degree', 'int', 4, 'Degree of the polynomial fitted to the motion in a window.',
        low=2, high=8,
    )  # fmt: skip
    filter_hop: float = _setting(
        'filter.hop', 'float', 0.05, 'Shortest time between two used windows; 0: use all.',
        unit='s', low=0.0, high=10.0,
    )  # fmt: skip
    filter_velocity: str = _setting(
        'filter.velocity', 'str', 'auto',
        'Source of the velocity; auto: measured if the joint states have it, else the position.',
        choices=('auto', 'measured', 'position'),
    )  # fmt: skip
    model_method: str = _setting(
        'model.method', 'str', 'SGP',
        'SGP: physics and Gaussian process; PR: physics only; GP: Gaussian process only.',
        choices=('SGP', 'PR', 'GP'), read_only=True,
    )  # fmt: skip
    model_kernel: str = _setting(
        'model.kernel', 'str', SquaredExponential.name,
        'Covariance function of the Gaussian process Z.',
        choices=KERNELS, read_only=True,
    )  # fmt: skip
    model_residual_inputs: tuple[str, ...] = _setting(
        'model.residual_inputs', 'str_array', ('default',),
        'Inputs of Z: default (stated by the robot), own, all, or names such as direction:pole.',
        read_only=True,
    )  # fmt: skip
    parameters_source: str = _setting(
        'parameters.source', 'str', 'joint',
        'Reported parameters: joint, fitted with Z; or physics, fitted without Z.',
        choices=('joint', 'physics'),
    )  # fmt: skip
    prior_scale: float = _setting(
        'prior.scale', 'float', 1.0, 'Factor on the prior standard deviation of W.',
        low=1e-9, high=1e12, read_only=True,
    )  # fmt: skip
    intervals_calibration: str = _setting(
        'intervals.calibration', 'str', 'always',
        'When intervals are scaled to recent prediction errors: always, only while the model '
        'learns, or never (off).',
        choices=('always', 'learning', 'off'),
    )  # fmt: skip
    process_weighting: str = _setting(
        'process.weighting', 'str', 'always',
        'When Z is weighted by its errors, compared with those of the physics alone: always, only '
        'while the model learns, or never (off: full weight).',
        choices=('always', 'learning', 'off'),
    )  # fmt: skip
    learning_enabled: bool = _setting(
        'learning.enabled',
        'bool',
        default=True,
        description='Learn from samples; false: only predict and score.',
    )
    learning_initial: int = _setting(
        'learning.initial', 'int', 50, 'Samples collected before the first fit.',
        low=4, high=100_000,
    )  # fmt: skip
    buffer_budget: int = _setting(
        'buffer.budget', 'int', 300, 'Number of samples in the buffer from which Z predicts.',
        low=4, high=5000,
    )  # fmt: skip
    buffer_remember: bool = _setting(
        'buffer.remember', 'bool', default=True,
        description='Keep the information of dropped samples on the parameters W.',
    )  # fmt: skip
    buffer_policy: str = _setting(
        'buffer.policy', 'str', 'oldest',
        'Sample that is dropped from a full buffer; coverage: one of the two closest inputs of Z.',
        choices=('oldest', 'least_informative', 'coverage'),
    )  # fmt: skip
    buffer_check_period: int = _setting(
        'buffer.check_period', 'int', 5000,
        'Learned samples between checks of the updated factorisation against a new one.',
        low=10, high=1_000_000,
    )  # fmt: skip
    buffer_mode: str = _setting(
        'buffer.mode', 'str', 'exact',
        'exact: Z predicts from the buffer; basis: from all samples, with inducing points.',
        choices=('exact', 'basis'), read_only=True,
    )  # fmt: skip
    basis_features: int = _setting(
        'basis.features', 'int', 100,
        'Largest number of inducing points per joint; in both modes W is estimated with them.',
        low=1, high=2000, read_only=True,
    )  # fmt: skip
    forgetting_samples: float = _setting(
        'forgetting.samples', 'float', 0.0,
        'Learned samples after which information on W has decayed to 1/e; 0: never forget.',
        low=0.0, high=1e9,
    )  # fmt: skip
    refit_enabled: bool = _setting(
        'refit.enabled',
        'bool',
        default=True,
        description='Refit the hyper-parameters while running.',
    )
    refit_period: int = _setting(
        'refit.period',
        'int',
        200,
        'Number of learned samples between two refits; a robot that rests postpones them.',
        low=10,
        high=1_000_000,
    )
    refit_restarts: int = _setting(
        'refit.restarts', 'int', 1,
        'Random starts of the optimiser in addition to the present values.',
        low=0, high=20,
    )  # fmt: skip
    seed: int = _setting(
        'seed', 'int', 0, 'Seed of the random starts of the optimiser.', low=0, high=2**31 - 1
    )
    hyper: tuple[JointHyperparameters, ...] = ()

    @classmethod
    def from_mapping(cls, values: Mapping[str, object], robot: Robot) -> EngineConfig:
        """Build a configuration from dotted names; what is not named keeps its default.

        Args:
            values: setting name to value.
            robot: whose joints name the hyper-parameters.

        Raises:
            ConfigError: unknown names, wrong types and values out of range, all in one error.
        """
        kernel = kernel_named(values.get('model.kernel'))
        known = {setting.name: setting for setting in describe_settings(robot, kernel.name)}
        window = known['filter.window']
        problems, converted = [], {window.name: window.default}
        for name, value in values.items():
            problem = known[name].problem(value) if name in known else f'{name}: unknown setting'
            if problem:
                problems.append(problem)
            else:
                converted[name] = known[name].convert(value)
        hyper = tuple(
            JointHyperparameters.of_mapping(joint, kernel, converted)
            for joint in robot.joint_names
        )
        problems += _structural_problems(robot, converted, hyper)
        if problems:
            raise ConfigError(
                f'{len(problems)} wrong setting(s): ' + ' | '.join(problems),
                '',
                'see `ros2 param describe` or docs/settings.md',
            )
        return cls(
            hyper=hyper,
            **{  # type: ignore[arg-type]  # each value was checked against its setting
                name: converted[setting.name]
                for name, setting in _static_settings().items()
                if setting.name in converted
            },
        )

    def to_mapping(self) -> dict[str, SettingValue]:
        """Return every setting by its dotted name; `from_mapping` takes it back."""
        values = {s.name: getattr(self, name) for name, s in _static_settings().items()}
        for joint in self.hyper:
            values |= joint.to_mapping()
        return values

    def changed(self, changes: Mapping[str, object], robot: Robot) -> EngineConfig:
        """Return this configuration with `changes`; nothing changes when one of them is wrong.

        Raises:
            ConfigError: as `from_mapping`, or a change of a read-only setting.
        """
        known = {s.name: s for s in describe_settings(robot, self.model_kernel)}
        present = self.to_mapping()
        fixed = [
            name
            for name, value in changes.items()
            if name in known and known[name].read_only
            and known[name].problem(value) is None and known[name].convert(value) != present[name]
        ]  # fmt: skip
        if fixed:
            raise ConfigError(
                f'{", ".join(fixed)} cannot change while running',
                '',
                'restart the node with the new value',
            )
        return self.from_mapping({**present, **changes}, robot)


def _static_settings() -> dict[str, Setting]:
    return {f.name: f.metadata['setting'] for f in fields(EngineConfig) if 'setting' in f.metadata}


def _structural_problems(
    robot: Robot, values: Mapping[str, Any], hyper: tuple[JointHyperparameters, ...]
) -> list[str]:
    """Say what does not fit the robot: inputs, lengths and joint names."""
    problems = []
    unknown = [
        joint
        for joint in values.get('command.joints', ('',))
        if joint and joint not in robot.joint_names
    ]
    if unknown:
        problems.append(
            f'command.joints contains {unknown}: expected joints of {robot.joint_names}'
        )
    window = values['filter.window']
    if window < 0.0 and window != AUTOMATIC:
        problems.append(f'filter.window = {window:g}: expected 0 to 10 s, or -1 to choose it')
    try:
        columns = robot.residual_columns(values.get('model.residual_inputs', ('default',)))
    except ConfigError as error:
        return [*problems, str(error)]
    for joint, seen in zip(hyper, columns, strict=True):
        problems += joint.problems(len(seen))
    return problems


def describe_settings(robot: Robot, kernel: str = SquaredExponential.name) -> tuple[Setting, ...]:
    """Describe every setting that exists for `robot` with this kernel, in a fixed order."""
    dynamic: list[Setting] = []
    for joint in robot.joint_names:
        dynamic += describe(joint, robot.target_unit(joint), kernel_named(kernel))
    static = _static_settings()
    if 'effects' in robot.source:  # as a diagnosis leaves it: no settings were tuned for it
        window = static['filter_window']
        static['filter_window'] = replace(window, default=AUTOMATIC)
    return tuple(static.values()) + tuple(dynamic)
