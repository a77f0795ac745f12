"""Laws of `sgp compile`."""

from __future__ import annotations

import json
import subprocess
import sys

SCRIPT = """
import json
from pathlib import Path
from sgp_ros.apps.compiling import _loops, run_compile
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from test.engine.worlds import INVERSE_PENDULUM, PENDULUM, config, pendulum_events

def known():
    return {(loop.__module__, loop.__name__, str(s)) for loop in _loops() for s in loop.signatures}

found = run_compile(Path(), lambda share: None)
before = known()
for robot, settings in ((PENDULUM, {}), (PENDULUM, {'buffer__mode': 'basis'})):
    engine = Engine(robot, config(robot, **settings))
    replay(engine, pendulum_events(150), lambda step: None)
assert engine.counts.refits
print(json.dumps({'new': sorted(known() - before), **found}))
"""


def test_a_stream_compiles_nothing_that_was_not_compiled_ahead():
    """In a process of its own, as others compile too; what a replay with a fit calls is known."""
    run = subprocess.run(
        [sys.executable, '-c', SCRIPT], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    found = json.loads(lines[-1])
    assert found['new'] == []
    called = {*found['compiled'], *found['cached']}
    assert {
        'sgp_ros.gp.whitening_loops.whiten_input', 'sgp_ros.gp.rotations.absorb_sample',
        'sgp_ros.rigid.rigid_loops.fill_regressor', 'sgp_ros.rigid.mass_loops.fill_mass',
    } <= called  # fmt: skip
    assert lines[0].startswith(f'{len(found["compiled"])} loops compiled')
