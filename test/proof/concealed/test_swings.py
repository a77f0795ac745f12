"""Free swings: one drawn world, and the committed ones."""

from __future__ import annotations

import json

import pytest

from sgp_proof.concealed.swings import DRAG, KINDS, drawn
from sgp_proof.result_files import RESULTS


@pytest.mark.long
def test_drag_of_a_drawn_pendulum_is_named():
    world = drawn(KINDS.index(DRAG) + 2 * len(KINDS))
    assert world['is_right']
    (found,) = world['named']
    assert abs(found[2] / world['truth'][DRAG][0] - 1.0) < 0.1


def test_the_committed_worlds_name_nothing_where_nothing_is():
    worlds = json.loads((RESULTS / 'swings.json').read_text(encoding='utf-8'))['worlds']
    assert not any(w['named'] for w in worlds if not w['truth'])
    assert not any(w['is_wrong'] for w in worlds if len(w['truth']) == 1)
    assert not any(w['is_denied'] for w in worlds)
