"""Failures of repeated tests, as they are counted."""

from __future__ import annotations

import pytest

from sgp_proof.streams.flakes import failed_tests, run_once

TESTS = """
import pytest

@pytest.fixture
def broken():
    raise OSError

def test_good(): pass
def test_bad(): assert 0
def test_unready(broken): pass
def test_left_out(): pytest.skip()
"""


def test_failures_and_errors_are_counted_by_name(tmp_path):
    """Of a run, with its time; a test that is left out has not failed."""
    (tmp_path / 'test_some.py').write_text(TESTS)
    run = run_once([str(tmp_path), '--rootdir', str(tmp_path), '-c', '/dev/null'])
    assert [name.rsplit('::')[-1] for name in run['failed']] == ['test_bad', 'test_unready']
    assert run['tests'] == 4
    assert run['seconds'] > 0.0


@pytest.mark.parametrize('status', [-9, 2])
def test_a_run_without_a_report_is_a_failure(tmp_path, status):
    failed, count = failed_tests(tmp_path / 'missing.xml', status)
    assert failed == [f'pytest ended with status {status}']
    assert count == 0
