"""Additions of the site to the pages: version in the header, changelog, links to files.

Links to files of the repository that are no pages lead to the repository where mkdocs.yml names one
(`repo_url`); else their text stands alone.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[1]
_LINK = re.compile(r'(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)')


def on_config(config):
    """Return the settings with the version of the package in the name of the site."""
    config['site_name'] = f'{config["site_name"]} {version()}'
    return config


def version() -> str:
    """Return the version that the package states."""
    text = (ROOT / 'sgp_ros' / '__init__.py').read_text(encoding='utf-8')
    return re.search(r"^__version__ = '(.+)'", text, re.MULTILINE)[1]


def on_files(files, config):
    """Return the pages with the changelog among them."""
    text = markdown((ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8'))
    files.append(File.generated(config, 'changelog.md', content=text))
    return files


def markdown(text: str) -> str:
    """Return a changelog in reStructuredText as Markdown: headings, lists and code."""
    text = re.sub(r'^\^+\n(.+)\n\^+$', r'# \1', text, flags=re.MULTILINE)
    for line, mark in (('-', '##'), ('~', '###')):
        text = re.sub(rf'^(.+)\n{line}{{4,}}$', rf'{mark} \1\n', text, flags=re.MULTILINE)
    return text.replace('``', '`')


def on_page_markdown(markdown, page, config, files):
    """Return a page with such links replaced."""
    folder = posixpath.dirname(page.file.src_uri)

    def replaced(found):
        text, target, _ = found.groups()
        place = posixpath.normpath(posixpath.join(folder, target))
        if files.get_file_from_path(place) is not None:
            return found[0]
        repository = config.get('repo_url')
        inside = posixpath.normpath(posixpath.join('docs', place))
        return f'[{text}]({repository}/blob/main/{inside})' if repository else text

    return _LINK.sub(replaced, markdown)
