"""Worlds of position control can be drawn and read."""

from __future__ import annotations

import json

import pytest

from sgp_ros.recordings.reader import open_recording


@pytest.mark.long
def test_a_world_is_drawn_with_its_gains_and_answer(tmp_path):
    pytest.importorskip('mujoco')
    from sgp_proof.connection.servoed import draw_case

    draw_case(3, tmp_path)
    answer = json.loads((tmp_path / 'answer.json').read_text(encoding='utf-8'))
    assert [hidden['effect'] for hidden in answer['hidden']] == ['coulomb_friction']
    events = list(open_recording(tmp_path / 'real.mcap').events())
    assert len(events) > 1000
