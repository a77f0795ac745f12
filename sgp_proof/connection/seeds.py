"""Steps of the proofs of connections for a seed: draw a suitable world, score, write."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sgp_proof.concealed.run import OUTCOME, diagnose_case
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.physics.drawing import UnsuitableError

TRIES = 60
DrawCase = Callable[[int, Path, Path], bool]


def score_seeds(
    text: str,
    name: str,
    draw_case: DrawCase,
    scored: Callable[[dict[str, Any], dict[str, Any]], dict[str, Any]],
    summary: Callable[[list[dict[str, Any]]], dict[str, Any]],
) -> None:
    """Run the command of a proof.

    Args:
        text: its docstring.
        name: of the file of the result.
        draw_case: see `_diagnosed`.
        scored: of an answer and a diagnosis as `_diagnosed` returns them, a row.
        summary: of all rows.
    """
    parser = argparse.ArgumentParser(description=text.split('\n', maxsplit=1)[0])
    parser.add_argument('--seeds', default='0:20', help='FIRST:LAST+1[,...]')
    parser.add_argument('--outputs', type=Path, help='where worlds and diagnoses are kept')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.outputs or Path(scratch)
        seeds: Iterable[int] = (s for part in arguments.seeds.split(',') for s in seed_range(part))
        found = (_diagnosed(folder, seed, draw_case) for seed in seeds)
        rows = [scored(*world) for world in found if world is not None]
    report = {'seeds': arguments.seeds, 'summary': summary(rows), 'cases': rows}
    write_result(arguments.out / f'{name}.json', report)
    print(json.dumps(report['summary'], indent=1))


def draw_suitable(seed: int, letter: str, attempt: Callable[[np.random.Generator], None]) -> bool:
    """Make attempts at a world, each from numbers of its own; return whether one is suitable."""
    for number in range(TRIES):
        try:
            attempt(np.random.default_rng([seed, ord(letter), number]))
        except UnsuitableError:
            continue
        return True
    return False


def _diagnosed(
    folder: Path, seed: int, draw_case: DrawCase
) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Draw and diagnose one world, unless that was done before.

    Args:
        folder: of all of them.
        seed: of the world.
        draw_case: writes recordings, robot and answer, and returns whether there is a world.

    Returns:
        The answer with case and seconds, and the diagnosis: `{'refused': sentence}` of one that
        was refused. None without a world.
    """
    name = f'case_{seed:03d}'
    sealed, out, answer = (folder / kind / name for kind in ('cases', 'diagnoses', 'answers'))
    answer = answer.with_suffix('.json')
    if not answer.exists() and not draw_case(seed, sealed, answer):
        print(f'seed {seed}: no suitable world in {TRIES}', file=sys.stderr)
        return None
    if not (out / OUTCOME).exists():
        diagnose_case(sealed, out)
    outcome = json.loads((out / OUTCOME).read_text(encoding='utf-8'))
    row = json.loads(answer.read_text(encoding='utf-8'))
    row |= {'case': name, 'seconds': outcome['seconds']}
    if outcome['status']:
        return row, {'refused': outcome['why']}
    return row, json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
