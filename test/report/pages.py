"""Pages without the two scripts that each of them has."""

from __future__ import annotations

import json
import re


def content_of(page):
    """Return a page without its scripts; nothing else in it is one, or asks for another file."""
    text, data, script = re.fullmatch(
        r'(.*)<script type="application/json" id="chart-data">(.*?)</script>\n'
        r'<script>(.*)</script>\n</body>\n</html>\n?',
        page, re.DOTALL,
    ).groups()  # fmt: skip
    assert '<script' not in text
    assert '<' not in data
    assert '</script' not in script
    assert not re.search(r'https?:|url\((?!data:)|@import', text)
    assert all(a.startswith('data:') for a in re.findall(r'(?:src|href)="([^"]*)"', text))
    return text


def charts_of(page):
    """Return the data of the charts of a page by name."""
    return json.loads(re.search(r'id="chart-data">(.*?)</script>', page, re.DOTALL)[1])
