"""Every robot that comes with the package can be simulated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import robot_names
from sgp_ros.robots.shipped import shipped_folder

FILES = sorted(path.name for path in (shipped_folder() / 'robots').iterdir())
NAMES = sorted({*robot_names(), *FILES})


@pytest.mark.parametrize('name', NAMES)
def test_a_shipped_robot_is_simulated(name, tmp_path):
    """By its name, or by its file; it moves, and nothing grows beyond bounds."""
    robot = name if name in robot_names() else str(shipped_folder() / 'robots' / name)
    assert main(['simulate', robot, '--duration', '2', '--out', str(tmp_path)]) == 0
    (bag,) = tmp_path.glob('*.mcap')
    states = [e for e in open_recording(str(bag)).events() if hasattr(e, 'position')]
    position = np.array([state.position for state in states])
    assert np.all(np.ptp(position, axis=0).max() > 1e-3)
    assert np.all(np.abs(position) < 1e3)
    assert json.loads((tmp_path / 'truth.json').read_text(encoding='utf-8'))['robot']
