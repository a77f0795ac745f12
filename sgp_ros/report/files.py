"""Result files that appear under their name only when they are complete."""

from __future__ import annotations

import os
from pathlib import Path


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    growing = path.with_name(f'{path.name}.part')
    try:
        growing.write_bytes(content)
        os.replace(growing, path)  # noqa: PTH105 - atomic, also over an existing file
    except BaseException:
        growing.unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """Write `content` as UTF-8, as `write_bytes` does."""
    write_bytes(path, content.encode('utf-8'))
