"""Parts and chains of recordings, and robots without friction, for diagnoses of real machines.

python -m sgp_proof.real.withheld cut OUT TABLE --from S --to S
python -m sgp_proof.real.withheld join OUT NPZ [NPZ ...]
python -m sgp_proof.real.withheld friction OUT URDF
"""

from __future__ import annotations

import argparse
import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

PAUSE_S = 1.0


def cut(source: Path, target: Path, start: float, stop: float) -> None:
    """Write the rows of a table (CSV or NPZ) whose time is in [start, stop) [s].

    Time is the first column of a CSV and the array `t` of an NPZ.
    """
    if source.suffix == '.csv':
        with source.open(encoding='utf-8', newline='') as file:
            header, *rows = csv.reader(file)
        with target.open('w', encoding='utf-8', newline='') as file:
            kept = (row for row in rows if start <= float(row[0]) < stop)
            csv.writer(file).writerows([header, *kept])
        return
    with np.load(source, allow_pickle=False) as table:
        arrays = dict(table)
    inside = (arrays['t'] >= start) & (arrays['t'] < stop)
    np.savez(target, **{k: x[inside] if len(x) == len(inside) else x for k, x in arrays.items()})


def join(sources: list[Path], target: Path) -> None:
    """Write several NPZ recordings as one, a second of pause between them."""
    tables = [dict(np.load(source, allow_pickle=False)) for source in sources]
    begin = 0.0
    for table in tables:
        table['t'] = table['t'] - table['t'][0] + begin
        begin = table['t'][-1] + PAUSE_S
    np.savez(target, **{k: np.concatenate([table[k] for table in tables]) for k in tables[0]})


def without_friction(urdf: str) -> str:
    """Return a URDF without the `<dynamics>` of its joints, that is damping and friction."""
    return re.sub(r'\s*<dynamics\b[^>]*/>', '', urdf)


def main(argv: Sequence[str] | None = None) -> None:
    """Run one of the three commands; `argv` are its words, those of the process without."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('command', choices=('cut', 'join', 'friction'))
    parser.add_argument('target', type=Path)
    parser.add_argument('sources', type=Path, nargs='+')
    parser.add_argument('--from', dest='start', type=float, default=0.0)
    parser.add_argument('--to', dest='stop', type=float, default=np.inf)
    run(parser.parse_args(argv))


def run(arguments: argparse.Namespace) -> None:
    """Write what was asked for."""
    first = arguments.sources[0]
    if arguments.command == 'cut':
        cut(first, arguments.target, arguments.start, arguments.stop)
    elif arguments.command == 'join':
        join(arguments.sources, arguments.target)
    else:
        text = without_friction(first.read_text(encoding='utf-8'))
        arguments.target.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
