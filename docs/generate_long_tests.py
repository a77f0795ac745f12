"""Write docs/long_tests.md from the committed result: `python docs/generate_long_tests.py`."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

from sgp_proof.result_files import RESULTS

TARGET = Path(__file__).parent / 'long_tests.md'


def _summary(tests):
    """Return the numbers of tests by outcome, in words."""
    outcomes = sorted({test['outcome'] for test in tests}, key=lambda x: (x != 'passed', x))
    return ', '.join(f'{sum(t["outcome"] == x for t in tests)} {x}' for x in outcomes)


def text():
    """Return the page."""
    result = json.loads((RESULTS / 'long_tests.json').read_text(encoding='utf-8'))
    tests, found = result['tests'], result['environment']
    lines = [
        '# Tests that take long',
        '',
        'This page shows the last result of the tests that `make test` leaves out, because together they would take longer',
        'than the suite: whole diagnoses of many recordings, tutorials, simulations of errors. They are marked `long` in `test/`;',
        '`make proofs` runs them, writes [long_tests.json](../sgp_proof/results/long_tests.json) and generates this page from it.',
        '',
        f'{len(tests)} tests: {_summary(tests)}; {sum(t["seconds"] for t in tests) / 60:.0f} min in all, on {found["cores"]} cores of',
        f'{found["processor"]}, python {found["python"]}, numpy {found["numpy"]}, scipy {found["scipy"]}, numba {found["numba"]}.',
        '',
        '| file | tests | outcome | seconds | longest |',
        '|---|---|---|---|---|',
    ]  # fmt: skip
    files = itertools.groupby(sorted(tests, key=lambda t: t['file']), key=lambda t: t['file'])
    for file, group in files:
        own = list(group)
        longest = max(own, key=lambda t: t['seconds'])
        name = longest['test'].split('[')[0].removeprefix('test_').replace('_', ' ')
        lines.append(
            f'| [{file.removeprefix("test/")}](../{file}) | {len(own)} | {_summary(own)} | '
            f'{sum(t["seconds"] for t in own):.0f} | {name}: {longest["seconds"]:.0f} |'
        )
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
