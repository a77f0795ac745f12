"""Tests that take long: run all of them and keep what came out.

    python -m sgp_proof.long_tests [TEST ...] [--out FILE]

Marked `long` in `test/`, and left out of `make test`, which has to end within minutes. The status
is 1 if one fails. Of tests that are given, as to pytest, the results take the place of earlier
ones.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sgp_proof.result_files import ROOT, make_parser, write_result

OUTCOMES = ('failure', 'error', 'skipped')
"""Elements of a test that did not pass, in JUnit's format."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tests, write their results and return the status."""
    parser = make_parser(__doc__, 'long_tests')
    parser.add_argument('tests', nargs='*', metavar='TEST', help='file or test; all by default')
    options = parser.parse_args(argv)
    out = options.out.resolve()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / 'report.xml'
        words = ['-m', 'long', '-n', 'auto', '--max-worker-restart', '0', '--dist', 'loadfile']
        status = subprocess.run(
            [sys.executable, '-m', 'pytest', *words, f'--junitxml={report}', *options.tests],
            cwd=ROOT, check=False,
        ).returncode  # fmt: skip
        found = outcomes(report)
    if options.tests and out.is_file():
        found = merged(json.loads(out.read_text(encoding='utf-8'))['tests'], found)
    write_result(out, {'tests': found}, 'pytest')
    return int(status != 0)


def merged(
    earlier: Sequence[dict[str, Any]], found: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return all results, the later one of each test, by file and name."""
    by_name = {(t['file'], t['test']): t for t in (*earlier, *found)}
    return [by_name[key] for key in sorted(by_name)]


def outcomes(report: Path) -> list[dict[str, Any]]:
    """Return file, name, outcome and seconds of each test of a report in JUnit's format.

    Seconds include what a test prepares; a preparation that others share counts for the first.
    """
    cases = ET.parse(report).getroot().iter('testcase')
    return [
        {
            'file': case.attrib['classname'].replace('.', '/') + '.py',
            'test': case.attrib['name'],
            'outcome': next((x for x in OUTCOMES if case.find(x) is not None), 'passed'),
            'seconds': round(float(case.attrib['time']), 1),
        }
        for case in cases
    ]


if __name__ == '__main__':
    sys.exit(main())
