"""Where a command spends its processor time: `python -m sgp_proof.bench.stages diagnose ...`.

The functions that make its stages are timed in a process of their own, imports and all. No stage
holds another one, so their seconds and what is left add up to the whole.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

STAGES = {
    'diagnose': {
        'reading': ('sgp_ros.apps.diagnose._read', 'sgp_ros.diagnosis.pipeline.gather'),
        'connection': ('sgp_ros.diagnosis.connecting.search',),
        'screening': ('sgp_ros.diagnosis.explain.comparison.screen',),
        'fits': (
            'sgp_ros.diagnosis.explain.comparison.fit',
            'sgp_ros.diagnosis.decide.cross_validation.fit',
        ),
        'held-out proof': ('sgp_ros.diagnosis.pipeline.prove',),
        'replays to look at': ('sgp_ros.diagnosis.pipeline.overlays',),
        'report and figures': ('sgp_ros.apps.diagnose.write_examined',),
    },
    'identify': {
        'reading': ('sgp_ros.apps.identify.read_signals',),
        'choice of the filter': ('sgp_ros.batch.identification.choose_plan',),
        'choice of inputs': ('sgp_ros.batch.identification.choose_inputs',),
        'fits of four methods': ('sgp_ros.batch.identification.fit_offline',),
        'roll-outs': ('sgp_ros.apps.identify.roll_out_held',),
        'report and figures': ('sgp_ros.apps.identify.write_identified_recording',),
    },
}
"""Command to its stages, and the names under which those who call them know them."""


def stages_of(words: list[str]) -> dict[str, float]:
    """Return the processor seconds of each stage of a command in a process of its own.

    Raises:
        RuntimeError: the command failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / 'stages.json'
        process = subprocess.run(
            [sys.executable, '-m', 'sgp_proof.bench.stages', *words], check=False,
            env=os.environ | {'SGP_STAGES': str(found)},
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        if process.returncode:
            raise RuntimeError(f'sgp {" ".join(words)} ended with {process.returncode}')
        return dict(json.loads(found.read_text(encoding='utf-8')))


def _timed(seconds: Counter[str], stage: str, place: str) -> None:
    """Have a function add its time to its stage; inside another stage it is part of that one."""
    name, _, attribute = place.rpartition('.')
    module = importlib.import_module(name)
    work: Callable[..., Any] = getattr(module, attribute)

    def timing(*arguments: Any, **options: Any) -> Any:
        if seconds['running']:
            return work(*arguments, **options)
        seconds['running'], began = 1, time.process_time()
        try:
            return work(*arguments, **options)
        finally:
            seconds['running'] = 0
            seconds[stage] += time.process_time() - began  # type: ignore[assignment]

    setattr(module, attribute, timing)


def main(words: list[str]) -> int:
    """Run a command of `sgp`, and write its stages to the file that SGP_STAGES names."""
    seconds: Counter[str] = Counter()
    from sgp_ros.cli import main as sgp  # noqa: PLC0415 - imports are a stage

    for stage, places in STAGES[words[0]].items():
        for place in places:
            _timed(seconds, stage, place)
    seconds['imports'] = time.process_time()  # type: ignore[assignment]
    status = sgp(words)
    del seconds['running']
    whole = time.process_time()
    found = {name: seconds[name] for name in ('imports', *STAGES[words[0]])}
    found['the rest'] = whole - sum(found.values())
    Path(os.environ['SGP_STAGES']).write_text(json.dumps(found), encoding='utf-8')
    return status


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
