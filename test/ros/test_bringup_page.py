"""Statements of docs/bringup.md, beside stand-ins for the nodes of ros2_control.

ros2_control is on no registry for pip. This client publishes what its nodes publish: the URDF on
the latched topic robot_description, joint states of a joint_state_broadcaster, commands of a
JointTrajectoryController or of a controller of efforts.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sgp_ros.recordings.messages import header
from sgp_ros.robots.shipped import find_shipped, shipped_folder
from sgp_ros.ros.messages import new_message
from test.ros.graph import Graph
from test.ros.stream import START_NS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'bringup.md').read_text()
JOINTS = ['shoulder', 'elbow']
STEP_NS = 10**7
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TRAJECTORIES = '/joint_trajectory_controller/joint_trajectory'
EFFORTS = '/effort_controller/commands'


class Robot:
    """Plays the nodes of ros2_control for a pendulum of two joints."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        make = graph.client.create_publisher
        self._states = make(JointState, 'joint_states', 100)
        self._trajectories = make(JointTrajectory, TRAJECTORIES, 100)
        self._efforts = make(Float64MultiArray, EFFORTS, 100)
        description = make(String, 'robot_description', KEPT)
        urdf = (shipped_folder() / 'robots' / 'double_pendulum_a0.urdf').read_text()
        description.publish(String(data=urdf))
        self.is_stamped = True
        self._count = 0

    def move_until(self, is_done: Callable[[], Any], what: str) -> None:
        """Publish states and commands of both controllers until the node has what is asked."""

        def moved() -> bool:
            for _ in range(5):
                self._step()
            return bool(is_done())

        self._graph.wait_until(moved, what)

    def _step(self) -> None:
        self._count += 1
        t = self._count * STEP_NS * 1e-9
        stamp = header(new_message, START_NS + self._count * STEP_NS if self.is_stamped else 0)
        effort = [np.cos(3.0 * t), np.cos(3.0 * t + 1.0)]
        position, velocity = [np.sin(t), np.sin(t + 1.0)], [np.cos(t), np.cos(t + 1.0)]
        target = JointTrajectoryPoint(positions=position, velocities=velocity)
        self._trajectories.publish(
            JointTrajectory(header=stamp, joint_names=JOINTS, points=[target])
        )
        self._efforts.publish(Float64MultiArray(data=effort))
        self._states.publish(
            JointState(
                header=stamp, name=JOINTS, position=position, velocity=velocity, effort=effort
            )
        )


@pytest.fixture
def start(graph: Graph, tmp_path: Path) -> Callable[..., Robot]:
    """Start the node with the file of the page beside a robot."""
    file = find_shipped('bringup/ros2_control.yaml')
    assert file is not None

    def started(**given: Any) -> Robot:
        places = {'record__path': tmp_path / '{node}', 'save__path': tmp_path / '{node}'}
        graph.start('sgp_node', file=file, diagnostics__period=0.1, **places, **given)
        robot = Robot(graph)
        graph.wait_until(lambda: graph.status('model'), 'the robot')
        return robot

    return started


@pytest.mark.parametrize('page', ['README.md', 'docs/bringup.md'])
def test_the_commands_of_a_page_write_the_file_and_start_the_node_with_it(
    page: str, tmp_path: Path
) -> None:
    """As they stand there, with this package in place of what pip installs on the path."""
    text = (ROOT / page).read_text()
    (block,) = re.findall(
        r'```bash\n((?:(?!```).*\n)*sgp_node --parameters.*\n(?:.*\n)*?)```', text
    )
    lines = [line for line in block.splitlines() if line.startswith('sgp_node')]
    write, start = lines
    script = f'sgp_node() {{ {sys.executable} -m sgp_ros.ros.sgp_node "$@"; }}\n'
    done = subprocess.run(
        ['bash', '-ec', script + write], cwd=tmp_path, check=False, capture_output=True,
        text=True, env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (written,) = tmp_path.iterdir()
    assert written.read_bytes() == (ROOT / 'config/bringup/ros2_control.yaml').read_bytes()
    assert start.split('#')[0].split() == [
        'sgp_node', '--ros-args', '--params-file', written.name,
    ]  # fmt: skip


def test_the_section_of_the_readme_names_what_is_installed_and_called() -> None:
    """Extras of setup.py, and services and topics that the page on bringup explains."""
    text = (ROOT / 'README.md').read_text()
    section = text.split('## With a ros2_control robot')[1].split('## ')[0]
    (extras,) = re.findall(r"pip install '\.\[(.+?)\]'", section)
    setup = (ROOT / 'setup.py').read_text()
    assert all(f"'{extra}': [" in setup for extra in extras.split(','))
    for call in re.findall('ros2 service call .*', section):
        assert call in PAGE
    assert re.search(r'^sgp watch$', section, re.MULTILINE)
    assert len(text.splitlines()) < 150


@pytest.mark.ros
def test_the_file_of_the_page_works(
    graph: Graph, tmp_path: Path, start: Callable[..., Robot]
) -> None:
    """Beside a JointTrajectoryController, whose positions are not taken for efforts."""
    start().move_until(lambda: graph.status('model').get('ready') == '1', 'a model')
    assert (tmp_path / 'sgp_node' / 'sgp_node_0.mcap').is_file()
    (delay,) = re.findall(r'after its stamp \(([\d.]+) s in the file above\)', PAGE)
    timing = graph.status('timing')
    assert float(timing['delay_s_chosen']) == float(delay)
    assert float(timing['callback_ms_p50']) > float(timing['push_ms_p50'])
    assert graph.count('commands_read') == 0


@pytest.mark.ros
def test_the_commands_of_an_effort_controller_are_taken_by_a_remap(
    graph: Graph, start: Callable[..., Robot]
) -> None:
    robot = start(command__type='std_msgs/Float64MultiArray', remaps={'command': EFFORTS},
                  max_gap=10.0, command__timeout=10.0)  # fmt: skip
    robot.is_stamped = False  # on receipt, as the commands
    robot.move_until(lambda: graph.status('model').get('ready') == '1', 'a model')
    assert graph.count('commands_used') > 10


@pytest.mark.ros
def test_targets_of_position_are_refused_with_the_remedy(
    graph: Graph, start: Callable[..., Robot]
) -> None:
    robot = start(
        command__type='trajectory_msgs/JointTrajectory', remaps={'command': TRAJECTORIES}
    )
    robot.move_until(lambda: 'position targets' in graph.message('samples'), 'the remedy')
    assert 'set command.type to none' in graph.message('samples')


@pytest.mark.ros
def test_every_topic_and_service_of_the_page_is_offered(
    graph: Graph, start: Callable[..., Robot]
) -> None:
    start()
    rows = re.findall(r'^\| (`[~/].*?) \| ([\w, ]+) \|', PAGE, re.MULTILINE)
    assert len(rows) > 6
    topics = dict(graph.client.get_topic_names_and_types())
    for names, kinds in rows:
        found = re.findall(r'`(.+?)`', names)
        for i, name in enumerate(found):
            full = name.replace('~', '/sgp_node')
            kind = (kinds.split(', ') * len(found))[i]
            assert [k.rsplit('/', 1)[-1] for k in topics.get(full, [])] == [kind], name
    services = dict(graph.client.get_service_names_and_types())
    called = re.findall(r'ros2 service call (\S+) (\S+)', PAGE)
    assert called
    for name, kind in called:
        assert services.get(name) == [kind]
