"""Criteria have one home, and say what they mean."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from sgp_ros.diagnosis import criteria


def test_every_criterion_states_its_meaning_and_unit():
    """In the docstring that follows it."""
    body = ast.parse(Path(criteria.__file__).read_text(encoding='utf-8')).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign):
            assert isinstance(after, ast.Expr), ast.unparse(node)
            assert re.search(r'\[(1|nats|rows|s|Hz)\]\.', after.value.value), ast.unparse(node)
