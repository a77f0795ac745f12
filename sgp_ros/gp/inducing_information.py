"""Square-root information of a whole stream on W, each sample once, with Z in inducing points.

Z is linear in the weights of features as physics is in W, so one least-squares problem in
square-root form holds all that was ever learned: each sample is a row, rotated into the weights of
its outputs first, then into W. No sample counts twice, however often the robot returns to a place.

Other hyper-parameters take over that information without the stream. The weights of features are
values of Z: `z(B) = L theta`. Equations of the data alone, in which the prior of the weights has
no part, therefore hold for the features of another kernel too, with `theta = L^-1 Phi theta'`
where Phi are the new features at the old inducing inputs B. Then the new prior is added. What this
neglects is that the old kernel had interpolated between the inducing inputs: how far the new one
lets Z be from that is measured at the samples at hand. It counts as noise in place of the
remainders that were counted; where it would exceed all other noise, as for far shorter length
scales, the old equations say too little of Z, and Z is learned from the samples at hand again. W
keeps the information that it had.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy import linalg

from sgp_ros.gp.buffer import SampleBuffer
from sgp_ros.gp.factor import Whitening, part_of
from sgp_ros.gp.inducing_points import InducingPoints
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.model import Model, OutputGroup, group_of, output_groups

WORST = 2.0
"""By how much the noise of the old equations may grow: what is new is then no more than it was."""


def carried_over(
    points: InducingPoints, group: OutputGroup, samples: SampleBuffer
) -> InducingPoints:
    """Return the inducing points of some outputs under the hyper-parameters of `group`.

    Args:
        points: with the information of the stream.
        group: outputs among theirs, with other hyper-parameters.
        samples: of the stream that are at hand.
    """
    count, counted, _ = points.tally
    after = 1.0 + interpolation_error(points, group.kernel, samples.inputs) / group.noise
    growth = after * count / counted if count else 1.0
    if growth > WORST:
        return _relearned_locally(points, group, samples)
    carried = _carried(points, group, 1.0 / np.sqrt(growth))
    carried.tally[:] = points.tally * [1.0, growth, 1.0]
    return carried


def relearned(points: InducingPoints, group: OutputGroup, samples: SampleBuffer) -> InducingPoints:
    """As `carried_over` where the samples are the whole stream. O(n m (m + k p))."""
    fresh = InducingPoints(group, len(points.residuals[0].z), points.capacity)
    fresh.learn_anew(samples.inputs, samples.data, samples.weights)
    return fresh


def interpolation_error(points: InducingPoints, kernel: Kernel | None, U: np.ndarray) -> float:
    """Return the mean variance of Z at U (n, d) about its interpolation by their own kernel.

    With `a = K(B, B)^-1 k(B, u)`, for another `kernel` kappa, it is the mean of
    `kappa(u, u) - 2 a kappa(B, u) + a kappa(B, B) a`. O(n m^2).
    """
    own = points.group.kernel
    if own is None or kernel is None or not (points.size and len(U)):
        return 0.0
    B = np.array(points.inputs)
    a = linalg.cho_solve((points.lower, True), own.matrix(B, U))  # (m, n)
    explained = 2.0 * kernel.matrix(B, U) - kernel.matrix(B) @ a
    variance = kernel.diagonal(U) - (a * explained).sum(axis=0)
    return float(np.maximum(variance, 0.0).mean())


def _carried(points: InducingPoints, group: OutputGroup, weight: float) -> InducingPoints:
    chosen, ratios = _shares(points, group)
    p = len(points.residuals[0].z)
    fresh = InducingPoints(group, p, points.capacity)
    for residual, i, ratio in zip(fresh.residuals, chosen, ratios, strict=True):
        residual.add(points.residuals[i].scaled(weight * float(ratio)))
    m = points.size
    if not m:
        return fresh
    for u in points.inputs:
        fresh.join(u, fresh.features(u))
    Phi = fresh.feature_rows(np.array(points.inputs))  # (m, m')
    R, S = points.data
    S = S.reshape(m, -1, p + 1)[:, chosen] * ratios[:, None]
    R = np.sqrt(points.group.noise / group.noise) * R
    weights = R @ linalg.solve_triangular(points.lower, Phi, lower=True)
    fresh.take(weight * weights, weight * S.reshape(m, -1))
    return fresh


def _relearned_locally(
    points: InducingPoints, group: OutputGroup, samples: SampleBuffer
) -> InducingPoints:
    at_hand = relearned(points, points.group, samples)
    fresh = relearned(points, group, samples)
    whole, part = points.marginals(), at_hand.marginals()
    for residual, i, ratio in zip(fresh.residuals, *_shares(points, group), strict=True):
        residual.add(whole[i].less(part[i]).scaled(float(ratio)))
    return fresh


def _shares(points: InducingPoints, group: OutputGroup) -> tuple[list[int], np.ndarray]:
    """Return the outputs' places in the group, and old over new deviations of their noise."""
    chosen = [points.group.outputs.index(j) for j in group.outputs]
    old = np.sqrt(points.group.noise) * np.array(points.group.scales)[chosen]
    return chosen, old / (np.sqrt(group.noise) * np.array(group.scales))


class InducingInformation:
    """Inducing points of each group of outputs, and the information that is left on W.

    Attributes:
        sets: inducing points, one set per group of outputs that share a kernel.
        total: on W, the prior among it.
        unresolved: samples at which the features of an output had no room for what Z may do there.
            They tell W little, as if what Z does there were one and the same.

    Args:
        model: hyper-parameters.
        prior: of W.
        capacity: most features of each output.
    """

    def __init__(self, model: Model, prior: Information, capacity: int) -> None:
        self._prior = prior
        self._capacity = capacity
        self.sets = tuple(
            InducingPoints(group, len(prior.z), capacity) for group in output_groups(model)
        )
        self.total = prior.copy()
        self.unresolved = 0

    @classmethod
    def of_samples(
        cls, model: Model, prior: Information, capacity: int, samples: SampleBuffer
    ) -> InducingInformation:
        """Return the information of these samples, absorbed in the order in which they came."""
        basis = cls(model, prior, capacity)
        basis.absorb_samples(samples, 0, samples.size)
        return basis

    def absorb_samples(self, samples: SampleBuffer, start: int, stop: int) -> None:
        """Learn samples `start` to `stop`, as much as each counts."""
        chosen = slice(start, stop)
        for u, data, weight in zip(
            samples.inputs[chosen], samples.data[chosen], samples.weights[chosen], strict=True
        ):
            self.absorb(u, self.features(u), data, float(weight))

    def features(self, u: np.ndarray) -> tuple[Whitening, ...]:
        """Return the features at an input u (d,), one value per set. O(m^2 / 2) each."""
        return tuple(points.features(u) for points in self.sets)

    def absorb(
        self,
        u: np.ndarray,
        features: tuple[Whitening, ...],
        data: np.ndarray,
        weight: float = 1.0,
    ) -> None:
        """Learn regressors and, last, observations (k, p + 1) at the input u (d,) of `features`.

        O(m (m + k p) + k p^2). Equations of unit noise count `weight` times.
        """
        is_resolved = True
        for points, found in zip(self.sets, features, strict=True):
            self.total.absorb(points.absorb(u, found, data[points.place], weight))
            is_resolved &= points.is_resolved
        self.unresolved += not is_resolved

    def fade(self, forgetting: Forgetting) -> None:
        """Forget a little of the data, nothing of any prior."""
        forgetting.fade(self.total, [part for points in self.sets for part in points.residuals])
        if forgetting.factor != 1.0:
            for points in self.sets:
                self.total.absorb(points.fade(forgetting))

    def under(self, model: Model, samples: SampleBuffer, *, is_whole: bool) -> InducingInformation:
        """Return the information of the stream under other hyper-parameters.

        O(m^3 + n m^2) for each set whose hyper-parameters change; the others are taken over, so
        this basis must not learn any more. Outputs that come to share a kernel keep sets of
        their own.

        Args:
            model: the other hyper-parameters.
            samples: of the stream that are at hand.
            is_whole: whether these are the whole stream; it is then learned again.
        """
        changed = InducingInformation(model, self._prior, self._capacity)
        changed.unresolved = self.unresolved
        change = relearned if is_whole else carried_over
        groups = [
            (points, group_of(model, outputs))
            for points in self.sets
            for group in output_groups(model)
            if (outputs := tuple(j for j in group.outputs if j in points.group.outputs))
        ]
        changed.sets = tuple(
            points if group == points.group else change(points, group, samples)
            for points, group in groups
        )
        parts = [part for points in changed.sets for part in points.marginals()]
        rows, values = np.vstack([x.R for x in parts]), np.concatenate([x.z for x in parts])
        changed.total = self._prior.with_rows(rows, values)
        return changed

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restored` takes it back."""
        arrays = {
            'unresolved': np.array(self.unresolved), 'sets': np.array(len(self.sets)),
            'total_R': self.total.R, 'total_z': self.total.z,
        }  # fmt: skip
        for j, points in enumerate(self.sets):
            arrays |= {f'set{j}_{name}': array for name, array in points.state().items()}
        return arrays

    @classmethod
    def restored(
        cls, model: Model, prior: Information, capacity: int, state: Mapping[str, np.ndarray]
    ) -> InducingInformation:
        """Return a basis that continues exactly where `state` was taken."""
        basis = cls(model, prior, capacity)
        basis.unresolved = int(state['unresolved'])
        basis.total = Information(np.array(state['total_R']), np.array(state['total_z']))
        sets = []
        for j in range(int(state['sets'])):
            part = part_of(state, f'set{j}_')
            outputs = tuple(int(i) for i in part['outputs'])
            points = InducingPoints(group_of(model, outputs), len(prior.z), capacity)
            points.restore(part)
            sets.append(points)
        basis.sets = tuple(sets)
        return basis


class GradualFill:
    """Fills inducing points with the first samples of a buffer that no sample has left yet.

    All of them at the moment when the first one leaves would be the work of a whole buffer between
    two samples.

    Attributes:
        information: of the samples absorbed so far.
        count: of these samples.

    Args:
        information: before any sample.
    """

    def __init__(self, information: InducingInformation) -> None:
        self.information = information
        self.count = 0

    def catch_up(self, samples: SampleBuffer, room: int) -> None:
        """Absorb as many samples as are needed for none to be left after `room` more have come.

        With room for none, all of them.
        """
        share = math.ceil((samples.size - self.count) / max(room, 1))
        self.information.absorb_samples(samples, self.count, self.count + share)
        self.count += share
