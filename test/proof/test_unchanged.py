"""The comparison of numbers before and after a change."""

from __future__ import annotations

import json

import pytest

from sgp_proof.unchanged import differences


@pytest.fixture
def folders(tmp_path):
    """Write a result of each of two versions and return the folders."""

    def write(before, after):
        for name, result in (('before', before), ('after', after)):
            (tmp_path / name).mkdir()
            (tmp_path / name / 'results.json').write_text(json.dumps(result))
        return tmp_path / 'before', tmp_path / 'after'

    return write


def test_each_value_that_differs_is_named(folders):
    """By its path, with the relative difference; what passes with time does not count."""
    before = {'a': [1.0, {'b': 2.0}], 'verdict': 'one', 'seconds': 1.0, 'gone': None}
    after = {'a': [1.0, {'b': 2.5}], 'verdict': 'two', 'seconds': 2.0}
    lines = differences(*folders(before, after), 0.0)
    assert lines == [
        'results.json /a/1/b: 2 -> 2.5 (2.0e-01)',
        "results.json /gone: 'None' -> 'absent'",
        "results.json /verdict: 'one' -> 'two'",
    ]


def test_rounding_can_be_allowed(folders):
    """Up to a relative difference; files of one side alone are always named."""
    before, after = folders({'a': 1.0}, {'a': 1.0 + 1e-9})
    (after / 'more.json').write_text('{}')
    assert differences(before, after, 1e-8) == ['more.json: only after']
