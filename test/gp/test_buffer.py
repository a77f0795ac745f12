"""Laws of the buffered samples."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.buffer import SampleBuffer


@given(st.lists(st.integers(0, 5), max_size=40))
def test_a_buffer_is_the_list_of_what_came_and_was_not_dropped(dropped):
    """Any sample may leave; a copy with other room goes on like the original."""
    rng = np.random.default_rng(0)
    buffer, held = SampleBuffer.empty(2, 3).with_room(4), []
    for m in dropped:
        u, data = rng.normal(size=2), rng.normal(size=(2, 4))
        buffer.fade(0.5)
        buffer.append(u, data)
        held = [(x, rows, 0.5 * weight) for x, rows, weight in held]
        held.append((u, data, 1.0))
        if m < len(held):
            buffer.drop(m)
            del held[m]
        if len(held) == 4:
            buffer = buffer.with_room(9).with_room(5)
            buffer.drop(0)
            del held[0]
        seen = buffer.observations()
        assert buffer.size == len(held) == len(seen.U)
        for i, (u, data, weight) in enumerate(held):
            np.testing.assert_array_equal(seen.U[i], u)
            np.testing.assert_array_equal(seen.F[i], data[:, :-1])
            np.testing.assert_array_equal(seen.y[i], data[:, -1])
            assert buffer.weights[i] == weight
