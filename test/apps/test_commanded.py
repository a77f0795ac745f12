"""`sgp simulate ROBOT --commands REC`: recorded commands replayed through a robot."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter

INERTIA = 0.0846059
"""About the hinge, of the capsule [kg m2]."""
MJCF = """<mujoco model="swing"><worldbody><body pos="0 0 1">
<joint name="hinge" axis="0 1 0" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Where a machine, a model of it with too little damping, and a recording lie."""
    folder = tmp_path_factory.mktemp('commanded')
    for name, damping in (('machine', 0.2), ('model', 0.1)):
        (folder / f'{name}.xml').write_text(MJCF.format(damping=damping))
    words = [
        'simulate',
        folder / 'machine.xml',
        '--duration',
        6,
        '--rate',
        100,
        '--out',
        folder,
        '--force',
    ]
    assert main([str(x) for x in words]) == 0
    return folder


def _replayed(folder, bag, out, *options):
    words = ['simulate', folder / 'machine.xml', '--commands', bag, '--out', out, *options]
    assert main([str(x) for x in words]) == 0
    return json.loads((out / 'overlay.json').read_text())['recordings']


@pytest.mark.long
def test_the_machine_follows_its_recording_and_the_model_does_not(folder, tmp_path, capsys):
    """Errors, series, page and a recording on the clock of the first one."""
    bag = folder / 'machine.mcap'
    found = _replayed(folder, bag, tmp_path, '--nominal', folder / 'model.xml')['machine']
    assert list(found['modes']) == ['open_0.5', 'open_2', 'open_whole']
    for mode in found['modes'].values():
        ours, theirs = (mode['position_rms'][n]['hinge'] for n in ('simulated', 'nominal'))
        assert ours < 2e-3
        assert theirs > 5.0 * ours
    assert 'open_whole    nominal' in capsys.readouterr().out
    assert 'replayed through' in (tmp_path / 'report.html').read_text()
    with (tmp_path / 'replay.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert {'t', 'hinge_measured', 'hinge_open_2_nominal'} <= set(rows[0])
    shown = list(open_recording(tmp_path / 'swing_replayed.mcap').events())
    first = next(e.stamp_ns for e in open_recording(bag).events() if isinstance(e, JointSample))
    states = {e.stamp_ns: e.position[0] for e in shown if isinstance(e, JointSample)}
    assert len(states) > 100
    assert any(isinstance(e, CommandSample) for e in shown)
    row = rows[50]
    stamp = first + round(float(row['t']) * 1e9)
    near = min(states, key=lambda x: abs(x - stamp))
    assert states[near] == pytest.approx(float(row['hinge_open_whole_simulated']), abs=1e-6)


@pytest.mark.long
def test_targets_are_followed_in_closed_loop(folder, tmp_path):
    """With gains the drives act on the simulated motion; only then is the whole stable."""
    kp, kd, rate = 40.0, 3.0, 100
    q, v, rows = 0.3, 0.0, []
    for i in range(600):
        target = 0.3 + 0.4 * np.sin(0.03 * i) - 0.4 * np.sin(0.011 * i)
        rows.append((target, q, v))
        for _ in range(100):
            force = kp * (target - q) - (kd + 0.2) * v - 1.5 * 9.81 * 0.2 * np.sin(q)
            v += force / INERTIA * 1e-2 / rate
            q += v * 1e-2 / rate
    bag = tmp_path / 'servo.mcap'
    with RecordingWriter(bag, command_type=JOINT_STATE) as writer:
        for i, (target, x, rate_now) in enumerate(rows):
            stamp, at = 10**9 + i * 10**7, ('hinge',)
            writer.write_event(CommandSample(stamp, frozen_array([target]), at, POSITION))
            writer.write_event(JointSample(stamp, at, frozen_array([x]), frozen_array([rate_now])))
    (tmp_path / 'gains.yaml').write_text(f'kp: {{hinge: {kp}}}\nkd: {{hinge: {kd}}}\n')
    out = tmp_path / 'out'
    found = _replayed(folder, bag, out, '--gains', tmp_path / 'gains.yaml')['servo']
    assert found['modes']['closed_whole']['position_rms']['simulated']['hinge'] < 5e-3


def test_robots_of_other_joints_are_refused(folder, tmp_path, capsys):
    (tmp_path / 'other.xml').write_text(MJCF.format(damping=0.1).replace('hinge', 'knee'))
    words = ['simulate', folder / 'machine.xml', '--commands', folder / 'machine.mcap',
             '--nominal', tmp_path / 'other.xml', '--out', tmp_path / 'out']  # fmt: skip
    assert main([str(x) for x in words]) == 2
    said = capsys.readouterr().err
    assert "has the joints ['knee']; expected those of" in said
    assert said.count('\n') == 1
