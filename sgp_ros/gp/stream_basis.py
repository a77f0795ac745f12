"""What a whole stream tells of W, each sample once, with Z in features of a bounded number.

Z is linear in the weights of features as physics is in W, so one least-squares problem in
square-root form holds all that was ever learned: each sample is a row, rotated into the weights of
its outputs first, then into W. None counts twice, however often the robot comes back to a place.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sgp_ros.gp.factor import Whitening
from sgp_ros.gp.feature_block import FeatureBlock
from sgp_ros.gp.feature_change import changed_block, relearned_block
from sgp_ros.gp.forgetting import Forgetting
from sgp_ros.gp.information import Information
from sgp_ros.gp.model import Model
from sgp_ros.gp.output_groups import group_of, output_groups
from sgp_ros.gp.sample_buffer import SampleBuffer
from sgp_ros.gp.state_parts import part_of


class StreamBasis:
    """Blocks of features, one per group of outputs, and what they leave on W.

    Attributes:
        blocks: square-root information on the weights.
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
        self.blocks = tuple(
            FeatureBlock(group, len(prior.z), capacity) for group in output_groups(model)
        )
        self.total = prior.copy()
        self.unresolved = 0

    @classmethod
    def of_samples(
        cls, model: Model, prior: Information, capacity: int, samples: SampleBuffer
    ) -> StreamBasis:
        """Return what these samples tell, absorbed in the order in which they came."""
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
        """Return the features at an input u (d,), one value per block. O(m^2 / 2) each."""
        return tuple(block.features(u) for block in self.blocks)

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
        for block, found in zip(self.blocks, features, strict=True):
            self.total.absorb(block.absorb(u, found, data[list(block.group.outputs)], weight))
            is_resolved &= block.is_resolved
        self.unresolved += not is_resolved

    def fade(self, forgetting: Forgetting) -> None:
        """Forget a little of the data, nothing of any prior."""
        forgetting.fade(self.total, [told for block in self.blocks for told in block.told])
        if forgetting.factor != 1.0:
            for block in self.blocks:
                self.total.absorb(block.fade(forgetting))

    def under(self, model: Model, samples: SampleBuffer, *, is_whole: bool) -> StreamBasis:
        """Return what the stream tells under other hyper-parameters.

        O(m^3 + n m^2) for each block whose hyper-parameters change; the others are taken over, so
        this basis must not learn any more. Outputs that come to share a kernel keep blocks of
        their own.

        Args:
            model: the other hyper-parameters.
            samples: of the stream that are at hand.
            is_whole: whether these are the whole stream; it is then learned again.
        """
        changed = StreamBasis(model, self._prior, self._capacity)
        changed.unresolved = self.unresolved
        change = relearned_block if is_whole else changed_block
        groups = [
            (block, group_of(model, outputs))
            for block in self.blocks
            for group in output_groups(model)
            if (outputs := tuple(j for j in group.outputs if j in block.group.outputs))
        ]
        changed.blocks = tuple(
            block if group == block.group else change(block, group, samples)
            for block, group in groups
        )
        told = [part for block in changed.blocks for part in block.on_coefficients()]
        rows, values = np.vstack([x.R for x in told]), np.concatenate([x.z for x in told])
        changed.total = self._prior.with_rows(rows, values)
        return changed

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restored` takes it back."""
        arrays = {
            'unresolved': np.array(self.unresolved), 'blocks': np.array(len(self.blocks)),
            'total_R': self.total.R, 'total_z': self.total.z,
        }  # fmt: skip
        for j, block in enumerate(self.blocks):
            arrays |= {f'block{j}_{name}': array for name, array in block.state().items()}
        return arrays

    @classmethod
    def restored(
        cls, model: Model, prior: Information, capacity: int, state: Mapping[str, np.ndarray]
    ) -> StreamBasis:
        """Return a basis that continues exactly where `state` was taken."""
        basis = cls(model, prior, capacity)
        basis.unresolved = int(state['unresolved'])
        basis.total = Information(np.array(state['total_R']), np.array(state['total_z']))
        blocks = []
        for j in range(int(state['blocks'])):
            part = part_of(state, f'block{j}_')
            outputs = tuple(int(i) for i in part['outputs'])
            block = FeatureBlock(group_of(model, outputs), len(prior.z), capacity)
            block.restore(part)
            blocks.append(block)
        basis.blocks = tuple(blocks)
        return basis
