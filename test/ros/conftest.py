"""One domain of its own for the tests of the graph."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path

import pytest

pytest.importorskip('rclpy')
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'  # read when messages are imported

from collections.abc import Iterator

from test.ros.graph import Graph

_ROOT = Path(__file__).parents[2]
_DOMAINS = 101


@pytest.fixture(scope='session')
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Hold a domain that no other run uses, and set the environment of all nodes."""
    for turn in range(_DOMAINS):
        number = 1 + (os.getpid() + turn) % _DOMAINS
        path = Path(tempfile.gettempdir()) / f'sgp_ros_domain_{number}.lock'
        with path.open('w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            environment = {
                'ROS_DOMAIN_ID': str(number),
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',  # the profile stays on this host
                'FASTRTPS_DEFAULT_PROFILES_FILE': str(_ROOT / 'config/quick_discovery.xml'),
                'ROS_LOG_DIR': str(tmp_path_factory.mktemp('log')),
                'PYTHONPATH': str(_ROOT),
            }
            with pytest.MonkeyPatch.context() as patch:
                for name, value in environment.items():
                    patch.setenv(name, value)
                yield number
            path.unlink()
            return
    pytest.fail(f'all of {_DOMAINS} domains are taken')


@pytest.fixture(scope='session')
def context(domain: int) -> Iterator[int]:
    """Bring up rclpy in this process, once."""
    import rclpy

    rclpy.init()
    yield domain
    rclpy.try_shutdown()


@pytest.fixture
def graph(context: int, tmp_path: Path) -> Iterator[Graph]:
    """Return a client on the graph; the nodes it starts end with the test."""
    from test.ros.graph import Graph

    found = Graph(tmp_path)
    yield found
    found.close()
