"""Findings of errors of the connection."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.setup.connection import Connection, Tried
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.said import clear, error_finding


@pytest.mark.parametrize(('is_of_gains', 'expected'), [(True, 0.0671), (False, 0.005)])
def test_gains_are_as_uncertain_as_the_bodies_of_the_robot_file(is_of_gains, expected):
    """By 5 %; a number that nothing determines, or that is exact, has no deviation."""
    hypothesis = SimpleNamespace(
        joint='knee', effect='scale', words={}, is_of_gains=is_of_gains,
        names=('kp', 'kd', 'of'), units=('1', '1', '1'),
    )  # fmt: skip
    error = SimpleNamespace(
        hypothesis=hypothesis, worth=50.0, needed=60.0,
        numbers=np.array([1.34, 1.0, 1.0]), std=np.array([0.005, 0.0, np.inf]),
    )  # fmt: skip
    found = error_finding(SimpleNamespace(errors=[error], rivals=[()]), 0, 40.0)
    assert found.probability > 0.9
    assert found.parameters['kp'].std == pytest.approx(expected, rel=1e-2)
    assert found.parameters['kd'].std is None
    assert found.parameters['of'].std is None


@pytest.mark.parametrize(
    ('numbers', 'is_of_gains', 'is_kept'),
    [([1.007, 0.95], True, False), ([1.007, 0.85], True, True), ([1.007, 0.95], False, True),
     ([], False, True)],
)  # fmt: skip
def test_an_error_whose_intervals_hold_none_is_no_error(numbers, is_of_gains, is_kept):
    """Gains of 0.95 +- 0.1 may be those stated; an error without a number has no interval."""
    none = Correction.none(1)

    def error(numbers, is_of_gains):
        hypothesis = SimpleNamespace(
            is_of_gains=is_of_gains, neutral=np.ones(len(numbers)), applied=lambda *_: none
        )
        return Tried(hypothesis, np.array(numbers), np.full(len(numbers), 0.004), none, None)

    errors = error([], is_of_gains=False), error(numbers, is_of_gains)
    kept = clear(Connection(errors, ((), ()), None, None)).errors
    assert [len(e.numbers) for e in kept] == [0, len(numbers)][: 1 + is_kept]
