"""Folders of results: whether they are whole, and whether somebody still writes there."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import time
from pathlib import Path

import numpy as np

from sgp_ros.recordings.model_files import load_model
from sgp_ros.recordings.reader import open_recording

SETTLED_S = 10.0
"""Within which results take their names after a kill, on a computer however busy."""
TURN_S = 0.0005


def results_in(out: Path) -> dict[str, str]:
    """Return the results in a folder with what they hold."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in out.iterdir()
        if not path.name.startswith('.')
    }


def litter_in(out: Path) -> list[str]:
    """Return the names of hidden files that only a run that goes on may have."""
    return sorted(
        path.name for path in out.iterdir()
        if path.name.startswith('.') and not path.name.endswith('.json')
    )  # fmt: skip


def broken_in(out: Path) -> list[str]:
    """Return the results that are not whole, as their readers see them."""
    found = []
    for path in out.iterdir():
        if path.name.startswith('.'):
            continue
        try:
            if path.suffix == '.json':
                json.loads(path.read_text(encoding='utf-8'))
            elif path.name == 'model.npz':
                load_model(path)
            elif path.suffix == '.npz':
                with np.load(path, allow_pickle=False) as arrays:
                    _ = [arrays[name] for name in arrays.files]
            elif path.suffix == '.mcap':
                assert not open_recording(path).remarks
            else:
                ends = {'.html': b'</html>', '.png': b'IEND\xaeB`\x82', '.urdf': b'</robot>'}
                assert path.read_bytes().rstrip().endswith(ends.get(path.suffix, b''))
        except Exception as error:  # noqa: BLE001 - whatever a half file does to its reader
            found.append(f'{path.name}: {type(error).__name__}')
    return found


def wait_until_settled(out: Path) -> list[str]:
    """Wait until no process writes into a folder of results; return the fault where one does."""
    end = time.monotonic() + SETTLED_S
    while time.monotonic() < end:
        if not any(_is_locked(path) for path in out.glob('.sgp_*.lock')):
            return []
        time.sleep(TURN_S)
    return [f'still writing after {SETTLED_S} s']


def _is_locked(path: Path) -> bool:
    with contextlib.suppress(FileNotFoundError), path.open('rb') as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
