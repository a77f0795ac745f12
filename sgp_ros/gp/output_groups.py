"""Which outputs share one factor: those whose covariance is the same up to a scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.gp.kernels import Kernel
from sgp_ros.gp.model import Model

_SAME = 1e-12
"""Relative difference of signal-to-noise ratios up to which they are one ratio: rounding."""


@dataclass(frozen=True, slots=True)
class OutputGroup:
    """Outputs whose covariance is `scale^2 (K + noise I)` with one K.

    Attributes:
        kernel: of the first output; None where Z is zero.
        noise: of the first output.
        outputs: their indices.
        scales: one per output, 1 for the first.
    """

    kernel: Kernel | None
    noise: float
    outputs: tuple[int, ...]
    scales: tuple[float, ...]


def output_groups(model: Model) -> tuple[OutputGroup, ...]:
    """Return the groups of a model in the order of their first outputs."""
    found: list[OutputGroup] = []
    for j, (kernel, noise) in enumerate(zip(model.kernels, model.noise, strict=True)):
        for i, group in enumerate(found):
            if _is_multiple(kernel, noise, group):
                scales = (*group.scales, float(np.sqrt(noise / group.noise)))
                found[i] = OutputGroup(group.kernel, group.noise, (*group.outputs, j), scales)
                break
        else:
            found.append(OutputGroup(kernel, noise, (j,), (1.0,)))
    return tuple(found)


def separable(one: Model, other: Model) -> tuple[tuple[int, ...], ...]:
    """Return the finest sets of outputs that share no factor with others under either model."""
    sets = [{j} for j in range(len(one.noise))]
    for group in (*output_groups(one), *output_groups(other)):
        joined = [s for s in sets if s.intersection(group.outputs)]
        sets = [s for s in sets if s not in joined] + [set().union(*joined)]
    return tuple(tuple(sorted(s)) for s in sorted(sets, key=min))


def group_of(model: Model, outputs: tuple[int, ...]) -> OutputGroup:
    """Return some outputs of one group as a group of their own."""
    first = outputs[0]
    noise = model.noise[first]
    scales = tuple(float(np.sqrt(model.noise[j] / noise)) for j in outputs)
    return OutputGroup(model.kernels[first], noise, outputs, scales)


def _is_multiple(kernel: Kernel | None, noise: float, group: OutputGroup) -> bool:
    other = group.kernel
    if kernel is None or other is None:
        return kernel is other
    if (type(kernel), kernel.inputs, kernel.lengthscales) != (
        type(other), other.inputs, other.lengthscales
    ):  # fmt: skip
        return False
    heights = kernel.log_parameters[: -len(kernel.inputs)]
    others = other.log_parameters[: -len(kernel.inputs)]
    ratio = np.log(noise / group.noise)
    if not len(heights):
        return bool(ratio == 0.0)
    return bool(np.all(np.abs(heights - others - ratio) <= _SAME))
