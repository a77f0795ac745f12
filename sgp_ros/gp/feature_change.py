"""Takes what a stream told of Z to other hyper-parameters, without the stream.

The weights of features are values of Z: `z(B) = L theta`. Equations of the data alone, in which
the prior of the weights has no part, therefore hold for the features of another kernel too, with
`theta = L^-1 Phi theta'` where Phi are the new features at the old inducing inputs B. Then the new
prior is added. What this neglects is that the old kernel had interpolated between the inducing
inputs: how far the new one lets Z be from that is measured at the samples at hand. It counts as
noise in place of the remainders that were counted; where it would exceed all other noise, as for
far shorter length scales, the old equations say too little of Z, and Z is learned from the
samples at hand again. W keeps what the stream told of it.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from sgp_ros.gp.feature_block import FeatureBlock
from sgp_ros.gp.kernels import Kernel
from sgp_ros.gp.output_groups import OutputGroup
from sgp_ros.gp.sample_buffer import SampleBuffer

WORST = 2.0
"""By how much the noise of the old equations may grow: what is new is then no more than it was."""


def changed_block(block: FeatureBlock, group: OutputGroup, samples: SampleBuffer) -> FeatureBlock:
    """Return the block of some of its outputs under the hyper-parameters of `group`.

    Args:
        block: of what the stream told.
        group: outputs of the block, with other hyper-parameters.
        samples: of the stream that are at hand.
    """
    count, counted, _ = block.tally
    after = 1.0 + interpolation_error(block, group.kernel, samples.inputs) / group.noise
    growth = after * count / counted if count else 1.0
    if growth > WORST:
        return _relearned(block, group, samples)
    carried = _carried(block, group, 1.0 / np.sqrt(growth))
    carried.tally[:] = block.tally * [1.0, growth, 1.0]
    return carried


def relearned_block(
    block: FeatureBlock, group: OutputGroup, samples: SampleBuffer
) -> FeatureBlock:
    """As `changed_block` where the samples are the whole stream. O(n m (m + k p))."""
    fresh = FeatureBlock(group, len(block.told[0].z), block.capacity)
    fresh.learn_anew(samples.inputs, samples.data, samples.weights)
    return fresh


def interpolation_error(block: FeatureBlock, kernel: Kernel | None, U: np.ndarray) -> float:
    """Return the mean variance of Z at U (n, d) about its interpolation by the block's own kernel.

    With `a = K(B, B)^-1 k(B, u)`, for another `kernel` kappa, it is the mean of
    `kappa(u, u) - 2 a kappa(B, u) + a kappa(B, B) a`. O(n m^2).
    """
    own = block.group.kernel
    if own is None or kernel is None or not (block.size and len(U)):
        return 0.0
    B = np.array(block.inputs)
    a = linalg.cho_solve((block.lower, True), own.matrix(B, U))  # (m, n)
    explained = 2.0 * kernel.matrix(B, U) - kernel.matrix(B) @ a
    variance = kernel.diagonal(U) - (a * explained).sum(axis=0)
    return float(np.maximum(variance, 0.0).mean())


def _carried(block: FeatureBlock, group: OutputGroup, weight: float) -> FeatureBlock:
    chosen, ratios = _shares(block, group)
    p = len(block.told[0].z)
    fresh = FeatureBlock(group, p, block.capacity)
    for told, i, ratio in zip(fresh.told, chosen, ratios, strict=True):
        told.add(block.told[i].scaled(weight * float(ratio)))
    m = block.size
    if not m:
        return fresh
    for u in block.inputs:
        fresh.join(u, fresh.features(u))
    Phi = fresh.feature_rows(np.array(block.inputs))  # (m, m')
    R, S = block.data
    S = S.reshape(m, -1, p + 1)[:, chosen] * ratios[:, None]
    R = np.sqrt(block.group.noise / group.noise) * R
    weights = R @ linalg.solve_triangular(block.lower, Phi, lower=True)
    fresh.take(weight * weights, weight * S.reshape(m, -1))
    return fresh


def _relearned(block: FeatureBlock, group: OutputGroup, samples: SampleBuffer) -> FeatureBlock:
    at_hand = relearned_block(block, block.group, samples)
    fresh = relearned_block(block, group, samples)
    whole, part = block.on_coefficients(), at_hand.on_coefficients()
    for told, i, ratio in zip(fresh.told, *_shares(block, group), strict=True):
        told.add(whole[i].less(part[i]).scaled(float(ratio)))
    return fresh


def _shares(block: FeatureBlock, group: OutputGroup) -> tuple[list[int], np.ndarray]:
    """Return the outputs' places in the block, and old over new deviations of their noise."""
    chosen = [block.group.outputs.index(j) for j in group.outputs]
    old = np.sqrt(block.group.noise) * np.array(block.group.scales)[chosen]
    return chosen, old / (np.sqrt(group.noise) * np.array(group.scales))
