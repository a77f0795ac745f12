"""The benchmark of whole commands: what it draws, and what it says of growth."""

from __future__ import annotations

import json
import math

import pytest

from sgp_proof.bench import recordings
from sgp_proof.bench.recordings import draw_recording, measured, named
from sgp_proof.bench.sysid import IS_INSTALLED, SYSID_KEYS, sysid_row
from sgp_ros.recordings.reader import open_recording

COST = {'processor_s': 2.0, 'wall_s': 3.0, 'peak_megabytes': 100.0}


def test_a_drawn_recording_is_that_of_its_robot(tmp_path):
    """As many joints and seconds as asked for; the same numbers each time."""
    robot, recording = draw_recording(tmp_path, 3, 2.0)
    events = list(open_recording(str(recording)).events(None, None))
    states = [e for e in events if hasattr(e, 'position')]
    assert len(states[0].position) == 3
    assert len(states) == pytest.approx(2.0 * recordings.RATE_HZ, abs=1)
    assert all(name in robot.read_text(encoding='utf-8') for name in states[0].names)


def test_a_command_is_measured_in_a_process_of_its_own():
    """Seconds and memory are those of the command; one that fails is no result."""
    found = measured(['--version'])
    assert found['processor_s'] > 0.0
    assert found['peak_megabytes'] > 5.0
    with pytest.raises(RuntimeError, match='no_such_command'):
        measured(['no_such_command'])


def test_what_was_named_is_reported_with_its_error(tmp_path):
    """Without a finding nothing is; a level is compared with that of the drawn friction."""
    file = tmp_path / 'diagnosis.json'
    file.write_text('{"findings": []}', encoding='utf-8')
    assert named(tmp_path) == {'named': '', 'off_percent': ''}
    finding = {
        'joint': 'joint_2', 'effect': 'coulomb_friction', 'parameters': {'level': {'value': 3.3}},
    }  # fmt: skip
    file.write_text(json.dumps({'findings': [finding]}), encoding='utf-8')
    assert named(tmp_path)['named'] == 'coulomb_friction of joint_2'
    assert named(tmp_path)['off_percent'] == pytest.approx(10.0)


@pytest.mark.skipif(not IS_INSTALLED, reason='mujoco[sysid] is not installed')
def test_the_rival_that_knows_the_effect_finds_its_size(tmp_path):
    """Two seconds of three joints: within a fifth, alone and beside the rest."""
    row = sysid_row(*draw_recording(tmp_path, 3, 2.0), 'joint_2', 3.0)
    assert set(row) == set(SYSID_KEYS)
    assert row['sysid_one_off_percent'] < 20.0


def test_growth_is_measured_between_rows_that_differ_in_one_size(monkeypatch):
    """Costs as the square of the joints and linear in the length."""

    def cost(words):
        joints, seconds = map(float, words[1].rsplit('_')[-2:])
        return COST | {'processor_s': joints**2 * seconds}

    monkeypatch.setattr(recordings, 'measured', cost)
    monkeypatch.setattr(recordings, 'named', lambda _: {})
    monkeypatch.setattr(recordings, 'sysid_row', lambda *_: dict.fromkeys(SYSID_KEYS, 1.0))
    monkeypatch.setattr(recordings, 'draw_recording', lambda _, k, s: ('arm', f'arm_{k}_{s:g}'))
    rows = recordings.bench_diagnose({}, lambda share: None, is_quick=False)
    sizes = {'seconds': 1.0, 'joints': 2.0}
    for name, wanted in sizes.items():
        found = [row[f'exponent_{name}'] for row in rows if row[f'exponent_{name}'] != '']
        assert found
        assert all(math.isclose(x, wanted) for x in found)
