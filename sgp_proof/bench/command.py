"""`sgp bench`: benchmarks by name, their rows as JSON and as tables."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sgp_proof.bench.evidence import bench_evidence
from sgp_proof.bench.recordings import bench_diagnose, bench_identify, bench_stages
from sgp_proof.bench.replay import bench_replay
from sgp_proof.bench.rivals import RIVALS
from sgp_proof.bench.step import bench_step
from sgp_proof.campaign.overhead import bench_campaign
from sgp_proof.result_files import machine
from sgp_ros.errors import ConfigError
from sgp_ros.report.files import replacing_results, write_text

BENCHES = {
    'step': bench_step, 'evidence': bench_evidence, 'replay': bench_replay,
    'diagnose': bench_diagnose, 'identify': bench_identify, 'stages': bench_stages,
    'campaign': bench_campaign,
}  # fmt: skip
"""Name to what returns the rows."""

SCHEMA = 1


def run_bench(
    names: Sequence[str],
    out: Path,
    progress: Callable[[float], None],
    *,
    is_quick: bool = False,
) -> dict[str, Any]:
    """Run benchmarks and write bench.json and bench.md.

    Args:
        names: keys of `BENCHES`; none for all.
        out: folder of the results.
        progress: called with the share that is done.
        is_quick: small sizes, to see that everything runs.

    Raises:
        ConfigError: no such benchmark.
    """
    chosen = tuple(dict.fromkeys(names)) or tuple(BENCHES)
    unknown = [name for name in chosen if name not in BENCHES]
    if unknown:
        raise ConfigError(
            f'the benchmark {unknown[0]!r}', f'one of {", ".join(BENCHES)}', 'correct the name'
        )
    for name, rival in RIVALS.items():
        if rival is None:
            sys.stderr.write(
                f'sgp bench: {name} is not installed, its columns stay empty; '
                f"pip install 'sgp_ros[bench]' adds it\n"
            )
    result: dict[str, Any] = {'schema': SCHEMA, 'machine': machine()}
    for i, name in enumerate(chosen):

        def share(part: float, done: int = i) -> None:
            progress((done + part) / len(chosen))

        result[name] = BENCHES[name](RIVALS, share, is_quick=is_quick)
    text = bench_tables(result)
    with replacing_results(out, 'bench'):
        write_text(out / 'bench.json', json.dumps(result, indent=1, allow_nan=False) + '\n')
        write_text(out / 'bench.md', text)
    print(text, end='')
    return result


def bench_tables(result: dict[str, Any]) -> str:
    """Return the rows of every benchmark as a Markdown table, the machine above."""
    lines = ['# Benchmarks', '', ', '.join(f'{k} {v}' for k, v in result['machine'].items())]
    for name in (name for name in BENCHES if name in result):
        rows = result[name]
        lines += ['', f'## {name}', '', f'| {" | ".join(rows[0])} |', '|---' * len(rows[0]) + '|']
        lines += [f'| {" | ".join(_cell(value) for value in row.values())} |' for row in rows]
    return '\n'.join(lines) + '\n'


def _cell(value: float | str | None) -> str:
    if value is None:
        return 'not installed'
    return f'{value:.4g}' if isinstance(value, float) else str(value)
