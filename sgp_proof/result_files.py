"""Result files of measurements: where they are, and the machine that stands beside the numbers."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
"""The repository."""
RESULTS = Path(__file__).parent / 'results'
"""The committed results, from which the pages of `docs/` are generated."""
PACKAGES = ('numpy', 'scipy', 'numba', 'torch', 'gpytorch', 'scikit-learn')


def machine(*packages: str) -> dict[str, str]:
    """Return processor, cores, system and the versions of `PACKAGES` and of further packages."""
    processor = Path('/proc/cpuinfo')
    lines = processor.read_text(encoding='utf-8').splitlines() if processor.exists() else []
    names = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
    found = {
        'processor': names[0] if names else platform.processor(),
        'cores': str(len(names)),
        'system': platform.platform(),
        'python': platform.python_version(),
    }
    for name in (*PACKAGES, *packages):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def make_parser(
    docstring: str | None, result: str, names: Iterable[str] = ()
) -> argparse.ArgumentParser:
    """Return a parser with `--out FILE`.

    Args:
        docstring: of the script; its first line is the description.
        result: stem of the committed file, the default of `--out`.
        names: parts that can be chosen by position; all of them without a choice.
    """
    parser = argparse.ArgumentParser(description=(docstring or '').split('\n')[0])
    parser.add_argument(
        '--out', type=Path, default=RESULTS / f'{result}.json', help='file of the result'
    )
    known = list(names)
    if known:
        parser.add_argument(
            'names', nargs='*', choices=[*known, known], default=known, metavar='NAME',
            help=', '.join(known),
        )  # fmt: skip
    return parser


def seed_range(text: str) -> range:
    """Return the seeds of `FIRST:LAST+1`."""
    first, last = map(int, text.split(':'))
    return range(first, last)


def read_result(path: Path) -> dict[str, Any]:
    """Return what a result file holds; nothing where there is none."""
    return json.loads(path.read_text(encoding='utf-8')) if path.is_file() else {}


def write_result(
    path: Path,
    content: Mapping[str, Any],
    *packages: str,
    schema: int = 1,
    indent: int | None = 1,
) -> None:
    """Write a result with its schema and the machine; further packages have their version there.

    The folder is made where there is none.

    Raises:
        ValueError: a number is not finite.
    """
    result = {'schema': schema, 'environment': machine(*packages), **content}
    text = json.dumps(result, indent=indent, allow_nan=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + '\n', encoding='utf-8')
