"""What a terminal shows and a command may overwrite: colour where it is wanted, folders of ours.

It is loaded with every command, so it imports nothing that takes time.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from sgp_ros.errors import ConfigError

_LISTING = '.sgp_'
"""Beginning of the names of the files that list the results of a command, see `report.files`."""


def strong(text: str) -> str:
    """Return text in bold where stdout is a terminal that wants colour (https://no-color.org)."""
    return _coloured(text, '1')


def warned(text: str) -> str:
    """Return text in yellow where stdout is a terminal that wants colour."""
    return _coloured(text, '33')


BESIDE_INPUT = ('import',)
"""Commands that add a recording to what is there: it may lie beside the log that it was."""


def require_own_folder(out: Path) -> None:
    """Refuse a folder with files of somebody else, which a command could mix with or replace.

    Results of `sgp` in it are replaced by the next run of the same command.

    Args:
        out: folder of the results.

    Raises:
        ConfigError: it holds files, and no command of ours wrote there.
    """
    if not out.is_dir():
        return
    names = sorted(path.name for path in out.iterdir())
    if names and not any(name.startswith(_LISTING) for name in names):
        shown = ', '.join(names[:3]) + (', ...' if len(names) > 3 else '')
        raise ConfigError(
            f'{out} contains files that sgp did not write ({shown})',
            'a new folder, or one that sgp wrote',
            'choose another --out, or add --force',
        )  # fmt: skip


def mark_folder(out: Path, command: str) -> None:
    """Leave a sign in a folder that a command of ours wrote there, where it left none itself.

    What runs that were killed have left there is removed.
    """
    if out.is_dir():
        from sgp_ros.strangers import remove_growing  # noqa: PLC0415 - it takes time

        remove_growing(out)
        listing = out / f'{_LISTING}{command}.json'
        if not listing.exists():
            listing.write_text('{}\n', encoding='utf-8')


def _coloured(text: str, code: str) -> str:
    wants = sys.stdout.isatty() and not os.environ.get('NO_COLOR')
    wants = wants and os.environ.get('TERM') != 'dumb'
    return f'\033[{code}m{text}\033[0m' if wants else text
