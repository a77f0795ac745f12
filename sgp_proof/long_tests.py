"""Tests that take long: run all of them and keep what came out.

    python -m sgp_proof.long_tests [--out FILE]

Marked `long` in `test/`, and left out of `make test`, which has to end within minutes. The status
is 1 if one fails.
"""

from __future__ import annotations

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
    out = make_parser(__doc__, 'long_tests').parse_args(argv).out.resolve()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / 'report.xml'
        words = ['-m', 'long', '-n', 'auto', '--max-worker-restart', '0', '--dist', 'loadfile']
        status = subprocess.run(
            [sys.executable, '-m', 'pytest', *words, f'--junitxml={report}'], cwd=ROOT, check=False
        ).returncode
        write_result(out, {'tests': outcomes(report)}, 'pytest')
    return int(status != 0)


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
