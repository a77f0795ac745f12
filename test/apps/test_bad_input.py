"""Files that do not belong together: one line says what was found, and nothing is written."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter

MJCF = """<mujoco model="swing"><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="{name}" axis="0 1 0" type="{kind}" damping="0.2" range="-3 3" limited="true"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator><motor joint="{name}"/></actuator></mujoco>"""
T = np.arange(500) * 0.01
Q = np.sin(3.0 * T)


@pytest.fixture
def robot(tmp_path):
    return _model(tmp_path, 'swing')


def _model(folder, stem, name='hinge', kind='hinge'):
    (folder / f'{stem}.xml').write_text(MJCF.format(name=name, kind=kind))
    return str(folder / f'{stem}.xml')


def _recording(folder, stem, q=Q, name='hinge', target=None):
    path = folder / f'{stem}.mcap'
    with RecordingWriter(path, command_type=JOINT_STATE) as writer:
        for i, t in enumerate(T):
            stamp = 10**9 + round(t * 1e9)
            if target is not None:
                asked = frozen_array([target[i]])
                writer.write_event(CommandSample(stamp, asked, (name,), POSITION))
            effort = frozen_array([np.cos(t)])
            writer.write_event(JointSample(stamp, (name,), frozen_array([q[i]]), None, effort))
    return str(path)


def _refused(capsys, folder, *words):
    """Return the one line that a command ends with; it leaves nothing behind."""
    out = folder / 'out'
    assert main([*words, '--out', str(out)]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert not out.exists()
    return said


def test_a_simulation_without_overlap_is_refused(tmp_path, robot, capsys):
    machine = _recording(tmp_path, 'machine')
    for stem, q, line in (
        ('still', 0.0 * Q, 'the machine moves hinge, the simulation nothing'),
        (
            'far',
            Q + 2.5,
            'no joint reaches the same positions on the machine and in the simulation: hinge -1',
        ),
    ):
        sim = _recording(tmp_path, stem, q)
        assert line in _refused(
            capsys, tmp_path, 'diagnose', machine, '--robot', robot, '--sim', sim
        )


@pytest.mark.long
def test_files_of_different_machines_are_refused(tmp_path, robot, capsys):
    """A recording, a held-out recording, a simulation: by names, then by kinds of joints."""
    ours, theirs = _recording(tmp_path, 'ours'), _recording(tmp_path, 'theirs', name='knee')
    given = 'diagnose', ours, '--robot', robot
    line = "theirs.mcap contains the joints ['knee']; expected states of the joints ['hinge']"
    assert line in _refused(capsys, tmp_path, 'diagnose', ours, theirs, '--robot', robot)
    assert line in _refused(capsys, tmp_path, *given, '--test', theirs)
    assert line in _refused(capsys, tmp_path, *given, '--sim', theirs)
    slides = _model(tmp_path, 'slides', kind='slide')
    line = 'simulation slides.xml is of another machine: hinge is prismatic there'
    assert line in _refused(capsys, tmp_path, *given, '--sim', slides)


def test_a_unit_that_the_ranges_contradict_is_refused(tmp_path, robot, capsys):
    """A name that says rad above numbers in degrees; without it the ranges decide."""
    table = tmp_path / 'log.npz'
    np.savez(table, t=T, q_rad=np.degrees(Q)[:, None], tau=Q[:, None])
    said = _refused(capsys, tmp_path, 'import', str(table), '--robot', robot)
    assert 'the positions of hinge go from -57.3 to 57.3, but its limits are -3 to 3 rad' in said
    assert 'expected the units stated' in said
    np.savez(table, t=T, q=np.degrees(Q)[:, None], tau=Q[:, None])
    words = ['import', str(table), '--robot', robot, '--out', str(tmp_path / 'out')]
    assert main(words) == 0


def test_a_target_in_another_unit_is_refused(tmp_path, robot, capsys):
    bag = _recording(tmp_path, 'servo', target=np.degrees(Q))
    gains = tmp_path / 'gains.yaml'
    gains.write_text('kp: {hinge: 9.0}\nkd: {hinge: 1.0}\n')
    words = 'diagnose', bag, '--robot', robot, '--gains', str(gains)
    said = _refused(capsys, tmp_path, *words)
    assert 'servo: the target of hinge is in degrees, its position is not' in said
