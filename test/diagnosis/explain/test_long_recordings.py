"""Comparison of models on a recording with more rows than are screened."""

from __future__ import annotations

import pytest

from sgp_ros.diagnosis.compare import sample
from sgp_ros.diagnosis.explain.comparison import MOST_PAIRS, MOST_SINGLES, PARENTS, compare_models


@pytest.mark.long
def test_few_rows_rank_what_all_rows_are_fitted_to(equations_for, viscous, monkeypatch):
    equations = equations_for(viscous)[1]
    whole = compare_models(equations, lambda _share: None)
    monkeypatch.setattr(sample, 'SCREENED_ROWS', len(equations.d) // 3)
    few = compare_models(equations, lambda _share: None)
    assert few.singles[0].key == whole.singles[0].key
    assert few.singles[0].effects[0].name == 'viscous_friction'
    assert {len(m.residual) for m in (*few.singles, *few.pairs)} == {len(equations.d)}
    assert 0 < len(few.singles) <= 2 * MOST_SINGLES < len(whole.singles)
    assert 0 < len(few.pairs) <= (PARENTS + 4) * MOST_PAIRS + 2
