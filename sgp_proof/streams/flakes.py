"""Tests of the node, repeated: how often each fails, and how long a run takes.

    python -m sgp_proof.streams.flakes --runs 20

A test that fails in some runs and not in others is a flake. With names, only these files or
folders are repeated. A run that ends before its tests do counts as a failure of `pytest` itself.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree as ET

from sgp_proof.result_files import ROOT, make_parser, write_result

TESTS = ['test/ros']


def failed_tests(report, status):
    """Return the tests that a report of pytest calls failed, and how many it has."""
    if not report.is_file():
        return [f'pytest ended with status {status}'], 0
    cases = list(ET.parse(report).iter('testcase'))
    failed = [
        f'{case.get("classname")}::{case.get("name")}'
        for case in cases
        if case.find('failure') is not None or case.find('error') is not None
    ]
    if status not in {0, 1} or (status and not failed):
        failed.append(f'pytest ended with status {status}')
    return failed, len(cases)


def run_once(tests):
    """Run the tests and return the result of the run."""
    with tempfile.TemporaryDirectory() as folder:
        report, began = Path(folder) / 'report.xml', time.monotonic()
        command = [sys.executable, '-m', 'pytest', *tests, '-q', '-p', 'no:cacheprovider']
        done = subprocess.run(
            [*command, f'--junitxml={report}'], cwd=ROOT, check=False, stdout=subprocess.DEVNULL
        )
        failed, count = failed_tests(report, done.returncode)
    return {
        'seconds': time.monotonic() - began, 'tests': count, 'failed': failed,
        'load': os.getloadavg()[0],
    }  # fmt: skip


def main():
    """Repeat the tests and write the result."""
    parser = make_parser(__doc__, 'flakes')
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('tests', nargs='*', default=TESTS, help='what pytest runs')
    arguments = parser.parse_args()
    runs = []
    for _ in range(arguments.runs):
        runs.append(run_once(arguments.tests))
        print(json.dumps(runs[-1]), flush=True)
    failures = Counter(name for run in runs for name in run['failed'])
    result = {'tests': arguments.tests, 'failures': dict(failures), 'runs': runs}
    write_result(arguments.out, result, 'pytest', 'ros-rclpy')


if __name__ == '__main__':
    main()
