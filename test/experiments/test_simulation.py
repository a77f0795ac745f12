"""Laws of `sgp simulate` for a robot from a URDF."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.cli import main
from test.simulation.trees import arm

EFFECT = 'coulomb_friction:joint=elbow,level=0.3'


@pytest.fixture
def urdf(tmp_path):
    """A planar arm on disk."""
    path = tmp_path / 'arm.urdf'
    path.write_text(arm(), encoding='utf-8')
    return path


def simulated(urdf, out, *more):
    assert main(['simulate', str(urdf), '--duration', '2', '--out', str(out), *more]) == 0
    return out


def test_recording_and_truth_of_a_urdf_robot(urdf, tmp_path):
    """Messages, effects with units and the true motion."""
    out = simulated(urdf, tmp_path / 'o', '--effect', EFFECT, '--sensor', 'effort=yes')
    truth = json.loads((out / 'truth.json').read_text(encoding='utf-8'))
    assert truth['effects'] == [
        {
            'effect': 'coulomb_friction',
            'joint': 'elbow',
            'parameters': {'level': {'value': 0.3, 'unit': 'N m'}},
        }
    ]
    motion = np.load(out / 'truth.npz', allow_pickle=False)
    assert motion['acceleration'].shape == (400, 2)
    assert (out / 'arm.mcap').stat().st_size > 10_000


def test_equal_seeds_write_equal_files(urdf, tmp_path):
    """Byte for byte, with noise on the way."""
    sensors = ['--sensor', 'bits=14', '--sensor', 'drop=0.01', '--sensor', 'log_latency=0.001']
    first, again = (simulated(urdf, tmp_path / x, *sensors, '--effect', EFFECT) for x in 'ab')
    for name in ('arm.mcap', 'truth.json', 'truth.npz'):
        assert (first / name).read_bytes() == (again / name).read_bytes()


@pytest.mark.parametrize(
    'more',
    [
        ['--effect', 'coulomb_friction:joint=wrist,level=1'],
        ['--effect', 'joint_coupling:joint=elbow,source_joint=elbow,kind=torque,coefficient=1'],
        ['--effect', 'backlash:joint=elbow,gap=0.01,motor_inertia=10'],
        ['--sensor', 'drop=2'],
        ['--controller', 'dance'],
    ],
)
def test_what_the_robot_cannot_have_ends_in_one_line(urdf, tmp_path, capsys, more):
    """Exit status 2, one line on stderr."""
    assert main(['simulate', str(urdf), '--out', str(tmp_path / 'o'), *more]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
