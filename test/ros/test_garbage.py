"""The fuzzer of messages, short and with fixed seeds, and bytes that are no message over DDS."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from sgp_proof.robustness.events import Faults
from sgp_proof.robustness.messages import run
from test.ros.graph import Graph
from test.ros.stream import Stream
from test.ros.test_node import QUICK

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(
    'seed', [1, 4, *(pytest.param(i, marks=pytest.mark.long) for i in (3, 8))]
)
def test_messages_of_all_kinds_are_used_or_counted(
    context: int, tmp_path: Path, seed: int
) -> None:
    """Nothing reaches the last resort of the node."""
    faults = Faults()
    counts = run(seed, 250, tmp_path, faults)
    assert dict(faults) == {}
    assert counts['state'] > 80


def _spoiled(good: bytes, rng: random.Random) -> bytes:
    """Return bytes cut off, changed, of a length that lies, or of nothing at all."""
    found, kind = bytearray(good), rng.randrange(4)
    if kind == 0:
        return bytes(found[: rng.randrange(len(found))])
    if kind == 1:
        for _ in range(rng.randrange(1, 6)):
            found[rng.randrange(len(found))] = rng.randrange(256)
    elif kind == 2:
        at = rng.randrange(4, len(found) - 4)
        found[at : at + 4] = b'\xff\xff\xff\x7f'
    else:
        return rng.randbytes(rng.randrange(200))
    return bytes(found)


def test_bytes_that_are_no_message_end_nothing(graph: Graph) -> None:
    """A node of another version, or a stranger on the network, may send them."""
    node = graph.start('sgp_node', **QUICK)
    stream, rng = Stream(graph), random.Random(0)
    good = serialize_message(JointState(name=['pole', 'wheel'], position=[0.1, 0.2]))
    for _ in range(150):
        stream.states.publish(_spoiled(good, rng))
        stream.commands.publish(_spoiled(good, rng))
        graph.turn(0.001)
    stream.publish_until_read(20)
    assert node.is_running
    assert graph.status('errors') == {}
