"""The documents: links lead somewhere, and no number was typed that a result file holds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md')])


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda p: p.name)
def test_relative_links_lead_to_files(path):
    """Every link that is no address is a file of this repository."""
    text = path.read_text(encoding='utf-8')
    for target in re.findall(r'\]\(([^)#]+)(?:#[^)]*)?\)', text):
        if '://' not in target:
            assert (path.parent / target).exists(), f'{path.name}: {target}'


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda p: p.name)
def test_commands_in_documents_exist(path):
    """`sgp NAME` and `make NAME` in a code block are commands of this version."""
    text = path.read_text(encoding='utf-8')
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    targets = set(re.findall(r'^(\w+):', makefile, re.MULTILINE))
    for block in re.findall(r'```(?:bash|console)\n(.*?)```', text, re.DOTALL):
        for name in re.findall(r'^\s*(?:\$ )?(?:\S*/)?sgp (\w+)', block, re.MULTILINE):
            assert name in {'demo', 'simulate', 'replay', 'import'}, name
        for name in re.findall(r'^\s*(?:\$ )?make (\w+)', block, re.MULTILINE):
            assert name in targets, name
