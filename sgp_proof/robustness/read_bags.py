"""Recordings that can be read, through the commands: each says what of them was not read.

A recording may be intact to the byte and hold what no robot has: odd ones are drawn here by seed.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.check import run_check
from sgp_ros.apps.identify import run_identify
from sgp_ros.apps.replay import run_replay
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.errors import SgpError
from sgp_ros.recordings.messages import TEXT
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.topics import CHANGES_TOPIC, GAINS_TOPIC
from sgp_ros.recordings.typestore import new_message
from sgp_ros.recordings.writer import RecordingWriter

COMMANDS: dict[str, Callable[..., dict[str, Any]]] = {
    'check': run_check, 'replay': run_replay, 'identify': run_identify,
}  # fmt: skip
_TEXTS = (
    '{"change": "reset", "stamp_ns": 1%s}' % ('0' * 400),
    '[' * 100_000,
    '{"change": "settings", "stamp_ns": 5, "settings": {"filter.window": 1e400}}',
    '{"change": "settings", "stamp_ns": 5, "settings": {"refit.period": 9%s}}' % ('9' * 99),
)
_STAMPS = (0, 1, 2**31 * 10**9 - 1)


def states(n: int) -> list[JointSample]:
    """Return a swing of one joint at 100 Hz with speed and effort."""
    t = np.arange(n) * 0.01
    q, v = np.sin(5.0 * t) + 0.3 * np.cos(13.0 * t), 5.0 * np.cos(5.0 * t) - 3.9 * np.sin(13.0 * t)
    u = 0.3 * np.tanh(20.0 * v) + 2.0 * np.sin(q) + 0.1 * v
    rows = zip(t, q, v, u, strict=True)
    return [
        JointSample(10**18 + round(a * 1e9), ('hinge',), *(frozen_array([x]) for x in row))
        for a, *row in rows
    ]


def write_odd(path: Path, n: int, rng: np.random.Generator) -> None:
    """Write an intact recording of numbers, stamps, names and topics that no robot has."""
    found, scale = states(n), 10.0 ** rng.uniform(-300.0, 300.0)
    channel = str(rng.choice(['position', 'velocity', 'effort']))
    share = float(rng.choice([0.01, 0.5, 1.0]))
    value = float(rng.choice([np.nan, np.inf, -1e308, 0.0, scale, scale]))
    for i in np.flatnonzero(rng.uniform(size=n) < share):
        with np.errstate(all='ignore'):
            x = getattr(found[i], channel) * value
        found[i] = replace(found[i], **{channel: frozen_array(x)})
    for i in rng.integers(n, size=int(rng.choice([0, 0, 1, 20]))):
        stamp = int(rng.choice(_STAMPS)) or max(found[i].stamp_ns - 10**9, 1)
        found[i] = replace(found[i], stamp_ns=stamp)
    with RecordingWriter(path) as writer:
        for event in found:
            writer.write_event(event)
        if not rng.integers(3):
            text = new_message(TEXT, data=_TEXTS[int(rng.integers(len(_TEXTS)))])
            writer._write(CHANGES_TOPIC, TEXT, found[0].stamp_ns, text)  # noqa: SLF001 - raw
        if not rng.integers(3):
            text = new_message(TEXT, data='kp: 3')
            writer._write(GAINS_TOPIC, TEXT, found[0].stamp_ns, text)  # noqa: SLF001 - as above


def read_bag(path: Path, n: int) -> tuple[str, ...]:
    """Read the states of a recording; return its remarks.

    Raises:
        AssertionError: fewer messages came than it had, or states, and nothing is said.
    """
    recording = open_recording(path)
    number = sum(1 for _ in recording.events(None, 'none'))
    stated = max(n, sum(t.count for t in recording.topics if t.last_name == 'joint_states'))
    assert number >= stated or recording.remarks, f'{number} of {stated} read in silence'
    return recording.remarks


def faults_of_commands(
    path: Path, robot: str, out: Path, remarks: tuple[str, ...]
) -> Iterator[str]:
    """Run each command on a recording that can be read; yield what is wrong with its results.

    Args:
        path: of the recording.
        robot: that moves in it.
        out: folder of the results.
        remarks: on the recording, which results must have.
    """
    for name, command in COMMANDS.items():
        printed = io.StringIO()
        try:
            with redirect_stdout(printed), warnings.catch_warnings():
                warnings.simplefilter('ignore')  # overflow is what numbers of 1e300 are for
                content = command(
                    bag=str(path), robot=robot, out=out / name, progress=lambda _: None
                )
        except (SgpError, OSError) as error:
            if '\n' in str(error):
                yield f'{name}: a message of several lines'
            continue
        for remark in remarks:
            if not any(remark in said for said in content['remarks']):
                yield f'{name}: a result without the remark {remark[:60]}'
            if remark not in printed.getvalue():
                yield f'{name}: the remark is not printed {remark[:60]}'
