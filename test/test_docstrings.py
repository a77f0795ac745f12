"""Examples in docstrings say what happens."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = [
    '.'.join(path.relative_to(ROOT).with_suffix('').parts)
    for path in sorted((ROOT / 'sgp_ros').rglob('*.py'))
    if '>>> ' in path.read_text(encoding='utf-8')
]


@pytest.mark.parametrize('name', EXAMPLES)
def test_examples_run_as_written(name):
    """Of every module that has some."""
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted
    assert not result.failed


def test_the_law_that_people_extend_has_an_example():
    """Of what people add, the docstring shows how."""
    assert 'sgp_ros.physics.effect' in EXAMPLES
