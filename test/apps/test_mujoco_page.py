"""The three commands of docs/mujoco.md, run as they stand there in an empty folder."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sgp_ros.cli import main

PAGE = Path(__file__).parents[2] / 'docs' / 'mujoco.md'
ARM = """<mujoco model="arm"><option timestep="0.0005" integrator="implicitfast"/>
<compiler angle="radian"/><default><joint damping="0.05"/>
<geom contype="0" conaffinity="0"/></default>
<worldbody><body name="upper" pos="0 0 .5"><joint name="shoulder" axis="0 1 0" {shoulder}/>
<geom type="capsule" fromto="0 0 0 .35 0 0" size=".04" mass="2.2"/>
<body name="fore" pos=".35 0 0"><joint name="elbow" axis="0 1 0" {elbow}/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1.2"/></body></body></worldbody>
<actuator><position joint="shoulder" kp="200" kv="9"/><position joint="elbow" kp="80" kv="3"/>
</actuator></mujoco>"""
KP, KD, DELAY_S, RATE_HZ, N = np.array([200.0, 80.0]), np.array([9.0, 3.0]), 0.012, 100, 1200


def _targets():
    t = np.arange(N) / RATE_HZ
    waves = [(0.6, 0.5, 0.31), (0.4, 1.1, 0.83), (0.3, 0.23, 1.27)]
    columns = [
        sum(a * np.sin(2.0 * np.pi * (f if j else g) * t + j) for a, f, g in waves)
        for j in range(2)
    ]
    return t, np.column_stack(columns) * np.minimum(1.0, t / 2.0)[:, None]


def _driven(model, targets, delay):
    """Return the motion under position control, (n, 2) positions and velocities."""
    data = mujoco.MjData(model)
    model.actuator_gainprm[:], model.actuator_biasprm[:] = 0.0, 0.0
    found = np.empty((2, N, 2))
    for row in range(N):
        found[:, row] = data.qpos, data.qvel
        while data.time < (row + 1) / RATE_HZ - 1e-9:
            at = max(int((data.time - delay) * RATE_HZ + 1e-6), 0)
            data.qfrc_applied[:] = KP * (targets[at] - data.qpos) - KD * data.qvel
            mujoco.mj_step(model, data)
    return found


def _followed(path, targets):
    """Return the positions of an MJCF file whose own actuators are given the targets."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    found = np.empty((N, 2))
    for row in range(N):
        found[row] = data.qpos
        data.ctrl[:] = targets[row]
        while data.time < (row + 1) / RATE_HZ - 1e-9:
            mujoco.mj_step(model, data)
    return found


@pytest.mark.long
def test_the_page_leads_from_model_and_log_to_a_corrected_model(tmp_path, monkeypatch, capsys):
    """In three commands; the corrected file follows the logged targets as the machine did."""
    (tmp_path / 'arm.xml').write_text(ARM.format(shoulder='', elbow=''))
    dry = 'frictionloss="{}" solreffriction=".002 1" solimpfriction=".99 .9999 .0001"'
    real = ARM.format(
        shoulder=dry.format(1.6), elbow=f'armature="0.05" {dry.format(0.7)}'
    )  # dry friction that sticks; MuJoCo's default creeps
    time, targets = _targets()
    q, dq = _driven(mujoco.MjModel.from_xml_string(real), targets, DELAY_S)
    np.savez(tmp_path / 'log.npz', time=time, q=q, dq=dq, q_des=targets, kp=KP, kd=KD)
    monkeypatch.chdir(tmp_path)
    block = re.search(r'```bash\n(.*?)```', PAGE.read_text(encoding='utf-8'), re.DOTALL)
    commands = block.group(1).strip().splitlines()
    assert len(commands) == 3
    for line in commands:
        program, *words = shlex.split(line)
        assert program == 'sgp'
        assert main(words) == 0, capsys.readouterr().err
    assert 'not in mjcf' not in capsys.readouterr().out
    found = json.loads((tmp_path / 'out' / 'diagnose' / 'diagnosis.json').read_text())
    assert not found['setup']
    assert {(f['joint'], f['effect']) for f in found['findings']} == {
        ('all', 'command_delay'),
        ('shoulder', 'coulomb_friction'),
        ('elbow', 'coulomb_friction'),
        ('elbow', 'armature'),
    }
    errors = [
        np.sqrt(np.mean((_followed(path, targets) - q) ** 2, axis=0))
        for path in (tmp_path / 'arm.xml', tmp_path / 'out' / 'export' / 'arm.xml')
    ]
    assert np.all(errors[1] < 0.2 * errors[0]), errors
