"""Laws that no list has against errors of the connection that were found before them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sgp_ros.diagnosis import connecting as module
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.connecting import with_laws


class _Worth(Connected):
    """Comparison with a given worth."""

    def worth(self, nominal, recorded, *, is_of_motion=False):
        return float(self.remarks[0])

    @property
    def nominal(self):
        return 0.0

    @property
    def verdict(self):
        return 'missing_physics'


@pytest.mark.parametrize(('gain', 'is_kept'), [(100.0, True), (12.0, False)])
def test_an_error_must_be_worth_more_than_the_law_alone(monkeypatch, gain, is_kept):
    """Its price is paid on top of that; without a law nothing is compared again."""
    from types import SimpleNamespace

    equations = SimpleNamespace(power=1.0)
    alone = _Worth(None, equations, None, remarks=('0',))
    error = SimpleNamespace()
    both = _Worth(None, equations, None, remarks=(str(gain),), findings=(error,),
                  uncorrected=alone, price=20.0)  # fmt: skip
    monkeypatch.setattr(module, 'extended', lambda several: (several, ('law',)))
    found = with_laws(both)
    assert (found.findings == (error,)) is is_kept
    assert found.laws == ('law',)
    monkeypatch.setattr(module, 'extended', lambda several: (several, ()))
    assert with_laws(replace(both, remarks=('12',))).findings == (error,)
