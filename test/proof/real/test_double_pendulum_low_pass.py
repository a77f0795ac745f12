"""The low-pass that the proof of the double pendulum sets is the one that a diagnosis uses."""

import pytest

from sgp_proof.real.double_pendulum_low_pass import low_pass
from sgp_ros.diagnosis import connected
from sgp_ros.diagnosis.compare.trajectory import Bandwidth


class _ReachedError(Exception):
    """The diagnosis has chosen its filters."""


@pytest.mark.parametrize(('cutoff', 'used'), [(2.0, 2.0), (None, 5.0)])
def test_a_diagnosis_uses_the_low_pass_that_was_set(monkeypatch, cutoff, used):
    chosen = []

    def require(_raw, bandwidth):
        chosen.append(bandwidth)
        raise _ReachedError

    monkeypatch.setattr(connected, 'choose_bandwidth', lambda *_: Bandwidth(5.0, 12.5))
    monkeypatch.setattr(connected, 'require_rows', require)
    recordings = type('Recordings', (), {'learned': None})
    with low_pass(cutoff), pytest.raises(_ReachedError):
        connected.compared(recordings, None, lambda _share: None)
    assert chosen == [Bandwidth(used, 2.5 * used)]
