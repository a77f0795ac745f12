"""The past of a robot reaches another process as it was, in few objects."""

from __future__ import annotations

import pickletools
from multiprocessing.reduction import ForkingPickler

import numpy as np

from sgp_ros.ros.past import Command, State, is_state, packed, unpacked


def _past(n: int) -> list[State | Command]:
    """Return n times a state with and one without velocity, a command, and one of other joints."""
    rng, names, past = np.random.default_rng(0), ('a', 'b'), []
    for i in range(n):
        t = 10**18 + 10**7 * i
        past.append((t, names, rng.normal(size=2), rng.normal(size=2), None, i))
        past.append((t + 1, names, rng.normal(size=2), None, None, i))
        past.append((t + 2, rng.normal(size=2), None, 'effort', None, i))
        past.append((t + 3, rng.normal(size=1), ('b',), 'position', rng.normal(size=1), i))
    return past


def test_samples_come_back_bit_for_bit_and_in_order() -> None:
    past = _past(5)
    found = unpacked(packed(past))
    assert [is_state(fields) for fields in found] == [True, True, False, False] * 5
    for one, other in zip(past, found, strict=True):
        for a, b in zip(one, other, strict=True):
            assert type(a) is type(b)
            assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


def test_nothing_is_no_sample() -> None:
    assert unpacked(packed([])) == []


def test_more_samples_are_no_more_objects_to_pickle() -> None:
    """Messages of the robot wait while objects are pickled, not while bytes are copied."""

    def operations(n: int) -> int:
        pickled = bytes(ForkingPickler.dumps(packed(_past(n))))
        return sum(1 for _ in pickletools.genops(pickled))

    assert operations(60) <= operations(6) + 2  # a number may take another operation
