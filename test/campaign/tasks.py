"""Tasks of tests, in a module that a worker loads at once."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def die_once(job):
    """A task that takes its worker with it, the first time."""
    mark = Path(job['mark'])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {'number': job['number']}


def break_down(_job):
    """A task with a bug."""
    raise ZeroDivisionError('of a bug\nin two lines')
