"""Time that the reading of a stranger's file may take."""

from __future__ import annotations

import pytest

from sgp_ros.apart import allowed_s


@pytest.mark.parametrize(
    ('name', 'seconds'), [('echo.yaml', 15.0), ('log.JSONL', 5.67), ('log.npz', 5.1)]
)
def test_text_that_is_parsed_has_longer_than_arrays(tmp_path, name, seconds):
    """A minute of `ros2 topic echo` took five seconds on a busy computer, and was refused."""
    path = tmp_path / name
    path.write_bytes(b' ' * 2_000_000)
    assert allowed_s(path) == pytest.approx(seconds, abs=0.01)
