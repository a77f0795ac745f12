"""Results of the tests that take long."""

from __future__ import annotations

from sgp_proof.long_tests import merged


def test_the_later_result_of_a_test_takes_the_place_of_the_earlier_one():
    old = [
        {'file': 'a.py', 'test': 'x', 'seconds': 1.0},
        {'file': 'b.py', 'test': 'x', 'seconds': 2.0},
    ]
    new = [
        {'file': 'a.py', 'test': 'x', 'seconds': 3.0},
        {'file': 'a.py', 'test': 'w', 'seconds': 4.0},
    ]
    assert [t['seconds'] for t in merged(old, new)] == [4.0, 3.0, 2.0]
