"""Names where large forces cancel: one drawn world, and the committed ones."""

from __future__ import annotations

import json

import pytest

from sgp_proof.concealed.cancelling import KINDS, drawn
from sgp_proof.result_files import RESULTS


@pytest.mark.long
def test_dry_friction_of_a_drawn_pendulum_is_named_for_the_accuracy_of_its_forces():
    world = drawn(KINDS.index('dry friction'))
    assert world['is_right']
    assert not world['is_wrong']
    assert not world['is_right_before']


def test_the_committed_worlds_name_friction_and_nothing_where_nothing_is():
    report = json.loads((RESULTS / 'cancelling.json').read_text(encoding='utf-8'))
    count = report['summary']
    assert count['nothing: wrong'] == count['dry friction: wrong'] == 0
    assert count['dry friction: right'] > 0.9 * count['dry friction']
    assert count['unlisted: wrong'] < 0.25 * count['unlisted']
