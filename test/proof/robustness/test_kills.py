"""The fuzzer of kills, short and with fixed seeds: a program that writes endlessly."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from sgp_proof.robustness.result_folders import (
    broken_in,
    litter_in,
    results_in,
    wait_until_settled,
)
from sgp_ros.report.files import replacing_results

NAMES = [f'{i}.json' for i in range(12)]
PROGRAM = """
import sys
from pathlib import Path
from sgp_ros.report.files import replacing_results, write_text
out = Path(sys.argv[1])
print('ready', flush=True)
for turn in range(1_000_000):
    with replacing_results(out, 'replay'):
        for i in range(12):
            write_text(out / f'{i}.json', str(turn))
        if turn % 2:
            write_text(out / 'odd.json', str(turn))
"""


@pytest.mark.parametrize('seed', range(6))
def test_a_kill_leaves_the_results_of_one_run(tmp_path, seed):
    """Those before or those after, whatever moment it comes at."""
    rng = random.Random(seed)
    process = subprocess.Popen(
        [sys.executable, '-c', PROGRAM, str(tmp_path)], stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == b'ready\n'
        limit = time.monotonic() + 30.0
        while len(results_in(tmp_path)) < len(NAMES):
            assert time.monotonic() < limit
        time.sleep(rng.uniform(0.0, 0.1))
        os.killpg(process.pid, (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM)[seed % 3])
        process.wait(timeout=10.0)
    finally:
        process.kill()
        process.communicate()
    assert wait_until_settled(tmp_path) == []
    assert len(set(results_in(tmp_path).values())) == 1
    with pytest.raises(ZeroDivisionError):
        _fail(tmp_path)
    found = results_in(tmp_path)
    assert len(set(found.values())) == 1
    assert set(found) - {'odd.json'} == set(NAMES)
    assert broken_in(tmp_path) == []
    with replacing_results(tmp_path, 'replay'):
        pass
    assert litter_in(tmp_path) == []


def _fail(out):
    """A run that comes upon an error: it adds nothing."""
    with replacing_results(out, 'replay'):
        1 / 0  # noqa: B018 - any error
