"""What the site does with links to files of the repository that are no pages.

They lead to the repository where mkdocs.yml names one (`repo_url`); else their text stands alone.
"""

from __future__ import annotations

import posixpath
import re

_LINK = re.compile(r'(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)')


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
