"""The fuzzer of events, short and with fixed seeds."""

from __future__ import annotations

import warnings

import pytest

from sgp_proof.robustness.events import Faults, run


@pytest.mark.parametrize('seed', range(12))
def test_garbage_is_learned_or_refused_and_counted(seed):
    """Nothing escapes, counts balance, memory is bounded, variances are positive."""
    faults = Faults()
    with warnings.catch_warnings(action='error'):
        engine = run(seed, 300, faults)
    assert dict(faults) == {}
    assert engine.counts.read + engine.counts.commands_read > 200
