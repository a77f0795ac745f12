"""Hyper-parameters as settings: `hyper.<joint>.*`, named by the kernel, and the noise beside them.

0 means "estimate it from the data".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sgp_ros.engine.samples import SettingValue
from sgp_ros.engine.setting import Setting
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.kernels import KERNELS, SquaredExponential
from sgp_ros.gp.model import Model

NOISE = 'noise_variance'
_AUTOMATIC = (0.0,)
_LARGEST_VARIANCE = 1e100


def prefix_of(joint: str) -> str:
    """Return what the names of all hyper-parameters of a joint begin with."""
    return f'hyper.{joint}.'


def kernel_named(name: object) -> type[Kernel]:
    """Return the kernel of that name; the default one for any other name."""
    return KERNELS.get(name, SquaredExponential) if isinstance(name, str) else SquaredExponential


@dataclass(frozen=True, slots=True)
class JointHyperparameters:
    """Hyper-parameters of the model of one joint; 0 means "from the data".

    Attributes:
        joint: the joint's name.
        kernel: of its Z.
        values: of `kernel.parameters`, numbers or one number per input of Z; `(0.0,)` for all
            inputs automatic.
        noise_variance: variance of V [target unit squared].
    """

    joint: str
    kernel: type[Kernel]
    values: tuple[float | tuple[float, ...], ...]
    noise_variance: float

    @classmethod
    def of_mapping(
        cls, joint: str, kernel: type[Kernel], values: Mapping[str, Any]
    ) -> JointHyperparameters:
        """Return those among the settings `values`; what is not among them is automatic."""
        prefix = prefix_of(joint)
        found = (
            values.get(prefix + p.name, _AUTOMATIC if p.is_per_input else 0.0)
            for p in kernel.parameters
        )
        return cls(joint, kernel, tuple(found), values.get(prefix + NOISE, 0.0))

    def to_mapping(self) -> dict[str, SettingValue]:
        """Return them as settings; `of_mapping` takes them back."""
        prefix = prefix_of(self.joint)
        settings: dict[str, SettingValue] = {prefix + NOISE: self.noise_variance}
        for parameter, value in zip(self.kernel.parameters, self.values, strict=True):
            settings[prefix + parameter.name] = value
        return settings

    @property
    def is_automatic(self) -> bool:
        """Whether any of them is still to be estimated."""
        return any(value in (0.0, _AUTOMATIC) for value in (*self.values, self.noise_variance))

    def problems(self, d: int) -> list[str]:
        """Say what does not fit a Z of d inputs."""
        return [
            f'{prefix_of(self.joint)}{p.name} = {list(value)}: expected {d} positive numbers, '
            'or [0.0] to estimate them'
            for p, value in zip(self.kernel.parameters, self.values, strict=True)
            if isinstance(value, tuple) and value != _AUTOMATIC
            and (len(value) != d or min(value) <= 0.0)
        ]  # fmt: skip

    def kernel_on(self, columns: tuple[int, ...], known: Kernel | None) -> Kernel:
        """Return the kernel of Z on these columns of U, as `known` where it is automatic."""
        flat: list[float] = []
        for parameter, given in zip(self.kernel.parameters, self.values, strict=True):
            value: float | tuple[float, ...] = given
            if given in (0.0, _AUTOMATIC):
                value = 1.0 if known is None else getattr(known, parameter.name)
            if parameter.is_per_input and not isinstance(value, tuple):
                value = (value,) * len(columns)
            flat += value if isinstance(value, tuple) else (value,)
        return self.kernel.of_values(flat, columns)


def describe(joint: str, unit: str, kernel: type[Kernel]) -> list[Setting]:
    """Describe the hyper-parameters of a joint whose target has this unit."""
    prefix = prefix_of(joint)
    described = [
        Setting(
            prefix + p.name,
            'float_array' if p.is_per_input else 'float',
            _AUTOMATIC if p.is_per_input else 0.0,
            f'{p.description}; '
            + ('[0.0]: estimate them.' if p.is_per_input else '0: estimate it.'),
            unit=p.unit(unit),
            low=0.0,
            high=p.high,
        )
        for p in kernel.parameters
    ]
    noise = Setting(
        prefix + NOISE, 'float', 0.0, 'Variance of the noise; 0: estimate it.',
        unit=f'({unit})^2', low=0.0, high=_LARGEST_VARIANCE,
    )  # fmt: skip
    return [*described, noise]


def settings_of(joints: tuple[str, ...], model: Model) -> dict[str, SettingValue]:
    """Return the hyper-parameters of a model of these joints as settings."""
    settings: dict[str, SettingValue] = {}
    for joint, kernel, noise in zip(joints, model.kernels, model.noise, strict=True):
        prefix = prefix_of(joint)
        settings[prefix + NOISE] = noise
        if kernel is not None:
            settings |= {prefix + p.name: getattr(kernel, p.name) for p in kernel.parameters}
    return settings
