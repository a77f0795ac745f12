"""Messages that a command could not read are printed, and stand in its results."""

from __future__ import annotations

import json
import math

import pytest

from sgp_ros.cli import main
from sgp_ros.engine.samples import JointSample, frozen_array
from test.recordings import worlds

START = 1_700_000_000 * 10**9
URDF = """<robot name="axis"><link name="base"/><joint name="axis" type="continuous">
<parent link="base"/><child link="rotor"/><axis xyz="0 0 1"/></joint><link name="rotor"/></robot>
"""
RESULTS = {'replay': 'metrics.json', 'check': 'check.json', 'identify': 'identification.json',
           'campaign': 'campaign.json'}  # fmt: skip


@pytest.fixture(scope='module')
def short(tmp_path_factory):
    """A robot, and a recording of whose 800 states one chunk of 80 has a flipped bit."""
    folder = tmp_path_factory.mktemp('short')
    (folder / 'axis.urdf').write_text(URDF)
    states = []
    for i in range(800):
        t = i * 0.01
        q, v = 0.6 * math.sin(2 * t) + 0.3 * math.sin(5.3 * t), 1.2 * math.cos(2 * t)
        u = -1.2 * math.sin(2 * t) - 4.2 * math.sin(5.3 * t) + 0.3 * math.tanh(10 * v)
        numbers = (frozen_array([x]) for x in (q, v + 1.59 * math.cos(5.3 * t), u))
        states.append(JointSample(START + i * 10**7, ('axis',), *numbers))
    path = folder / 'x.mcap'
    worlds.write_chunks(path, [states[i : i + 80] for i in range(0, 800, 80)])
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 0x40
    path.write_bytes(content)
    return folder


@pytest.mark.parametrize(
    'command',
    [pytest.param(x, marks=pytest.mark.long) if x == 'campaign' else x for x in RESULTS],
)
def test_a_short_read_is_said_wherever_results_are(command, short, tmp_path, capsys):
    words = [command, str(short / 'x.mcap'), '--robot', str(short / 'axis.urdf')]
    words += ['--task', 'identify', '--workers', '1'] if command == 'campaign' else []
    assert main([*words, '--out', str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    remarks = ' '.join(json.loads((tmp_path / RESULTS[command]).read_text())['remarks'])
    for said in ('/joint_states: only 720 of 800 messages read', 'x.mcap: damaged from byte'):
        assert said in printed
        assert said in remarks
