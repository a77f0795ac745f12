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
        'reorder_window', 'float', 0.1, 'Samples are ordered by stamp within this time.',
        unit='s', low=0.0, high=10.0,
    )  # fmt: skip
    max_gap: float = _setting(
        'max_gap', 'float', 0.25, 'A longer pause between states restarts the filter.',
        unit='s', low=1e-3, high=60.0,
    )  # fmt: skip
    command_timeout: float = _setting(
        'command.timeout', 'float', 1.0, 'A command older than this pairs with no state.',
        unit='s', low=1e-3, high=3600.0,
    )  # fmt: skip
    command_joints: tuple[str, ...] = _setting(
        'command.joints', 'str_array', ('',),
        "Joint order of a command array; [''] takes the robot's actuated joints.",
        read_only=True,
    )  # fmt: skip
    effort_source: str = _setting(
        'effort.source', 'str', 'auto',
        'Where effort comes from; auto takes the measured one where the state carries it.',
        choices=('auto', 'state', 'command'),
    )  # fmt: skip
    filter_window: float = _setting(
        'filter.window', 'float', 0.1,
        'Length of the differentiation window; half is the delay. -1: the first seconds choose.',
        unit='s', low=-1.0, high=10.0,
    )  # fmt: skip
    filter_degree: int = _setting(
        'filter.degree', 'int', 4, 'Degree of the polynomial that follows the motion in a window.',
        low=2, high=8,
    )  # fmt: skip
    filter_hop: float = _setting(
        'filter.hop', 'float', 0.05, 'Least time between two used windows; 0 uses every one.',
        unit='s', low=0.0, high=10.0,
    )  # fmt: skip
    filter_velocity: str = _setting(
        'filter.velocity', 'str', 'auto',
        'Where velocity comes from; auto takes the measured one where the state carries it.',
        choices=('auto', 'measured', 'position'),
    )  # fmt: skip
    model_method: str = _setting(
        'model.method', 'str', 'SGP', 'SGP: physics and process; PR: physics; GP: process.',
        choices=('SGP', 'PR', 'GP'), read_only=True,
    )  # fmt: skip
    model_kernel: str = _setting(
        'model.kernel', 'str', SquaredExponential.name, 'Covariance function of Z.',
        choices=KERNELS, read_only=True,
    )  # fmt: skip
    model_residual_inputs: tuple[str, ...] = _setting(
        'model.residual_inputs', 'str_array', ('default',),
        'What Z sees: default (the choice of the robot), all, own, or names (direction:pole).',
        read_only=True,
    )  # fmt: skip
    parameters_source: str = _setting(
        'parameters.source', 'str', 'joint',
        'Parameters reported: joint beside Z, or physics alone, where Z can imitate its columns.',
        choices=('joint', 'physics'),
    )  # fmt: skip
    prior_scale: float = _setting(
        'prior.scale', 'float', 1.0, 'Factor on the prior standard deviation of W.',
        low=1e-9, high=1e12, read_only=True,
    )  # fmt: skip
    intervals_calibration: str = _setting(
        'intervals.calibration', 'str', 'always',
        'When the errors of predictions set the width of the next intervals: always, only while '
        'the model learns, or off: as the model states them.',
        choices=('always', 'learning', 'off'),
    )  # fmt: skip
    process_weighting: str = _setting(
        'process.weighting', 'str', 'always',
        'When errors beside those of the physics alone weigh Z in predictions: always, only while '
        'the model learns, or off: Z counts in full.',
        choices=('always', 'learning', 'off'),
    )  # fmt: skip
    learning_enabled: bool = _setting(
        'learning.enabled', 'bool', default=True, description='Learn from samples, not only score.'
    )
    learning_initial: int = _setting(
        'learning.initial', 'int', 50, 'Samples gathered before the first model exists.',
        low=4, high=100_000,
    )  # fmt: skip
    buffer_budget: int = _setting(
        'buffer.budget', 'int', 300, 'Samples that the process Z is conditioned on.',
        low=4, high=5000,
    )  # fmt: skip
    buffer_remember: bool = _setting(
        'buffer.remember', 'bool', default=True,
        description='Keep the information of dropped samples on W.',
    )  # fmt: skip
    buffer_policy: str = _setting(
        'buffer.policy', 'str', 'oldest',
        'Which sample leaves a full buffer; coverage parts the closest two inputs of Z.',
        choices=('oldest', 'least_informative', 'coverage'),
    )  # fmt: skip
    buffer_check_period: int = _setting(
        'buffer.check_period', 'int', 5000,
        'Learned samples between two comparisons of an exact factor with one computed anew.',
        low=10, high=1_000_000,
    )  # fmt: skip
    buffer_mode: str = _setting(
        'buffer.mode', 'str', 'exact',
        'exact: Z is conditioned on the buffer; basis: on the whole stream, in a basis of Z.',
        choices=('exact', 'basis'), read_only=True,
    )  # fmt: skip
    basis_features: int = _setting(
        'basis.features', 'int', 100,
        'Most features of the basis of each joint, which tells W in both modes.',
        low=1, high=2000, read_only=True,
    )  # fmt: skip
    forgetting_samples: float = _setting(
        'forgetting.samples', 'float', 0.0,
        'Learned samples after which what is known of W counts 1/e; 0 never forgets.',
        low=0.0, high=1e9,
    )  # fmt: skip
    refit_enabled: bool = _setting(
        'refit.enabled', 'bool', default=True, description='Refit the hyper-parameters.'
    )
    refit_period: int = _setting(
        'refit.period', 'int', 200, 'Learned samples between two refits.', low=10, high=1_000_000
    )
    refit_restarts: int = _setting(
        'refit.restarts', 'int', 1, 'Starts of the optimiser beside the present values.',
        low=0, high=20,
    )  # fmt: skip
    seed: int = _setting(
        'seed', 'int', 0, 'Seed of the restarts of the optimiser.', low=0, high=2**31 - 1
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
                f'{len(problems)} wrong settings: ' + ' | '.join(problems),
                '',
                'see `ros2 param describe` or the documentation of the settings',
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
                f'{", ".join(fixed)} cannot change while running', '', 'restart with the new value'
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
        problems.append(f'command.joints names {unknown}: the robot has {robot.joint_names}')
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
