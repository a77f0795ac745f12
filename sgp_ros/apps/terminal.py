"""Terminal output and output folders: colour where it is wanted, overwriting only our own.

It is loaded with every command, so it imports nothing that takes time.
"""

from __future__ import annotations

import json
import os
import stat
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from sgp_ros.errors import ConfigError, SgpError

_LISTING = '.sgp_'
"""Beginning of the names of the files that list the results of a command, see `report.files`."""


def strong(text: str) -> str:
    """Return text in bold where stdout is a terminal that wants colour (https://no-color.org)."""
    return _coloured(text, '1')


def warned(text: str) -> str:
    """Return text in yellow where stdout is a terminal that wants colour."""
    return _coloured(text, '33')


WITHOUT_RESULTS = ('robots', 'compile', 'watch')
"""Commands that print what they have to say and have no --out."""
BESIDE_INPUT = 'import'
"""The command that adds a recording to what is there: it may lie beside the log that it was."""
_IMPORTS = f'{_LISTING}{BESIDE_INPUT}_'


def require_own_folder(out: Path) -> None:
    """Refuse a folder with files of somebody else, which a command could mix with or replace.

    Results of `sgp` in it are replaced by the next run of the same command. Imported recordings
    make no folder ours: they may lie beside the logs that they were.

    Args:
        out: folder of the results.

    Raises:
        ConfigError: it holds files and no command of ours wrote there, or it is a file.
    """
    if out.exists() and not out.is_dir():
        raise ConfigError(f'--out {out} is a file', 'a folder', 'choose another --out')
    if not out.is_dir():
        return
    names = sorted({path.name for path in out.iterdir()} - _imported(out))
    if not all(name.startswith(_LISTING) for name in names) and not _is_marked(out, names):
        shown = ', '.join(names[:3]) + (', ...' if len(names) > 3 else '')
        raise ConfigError(
            f'{out} contains files that sgp did not write ({shown})',
            'a new folder, or one that sgp wrote',
            'choose another --out, or add --force',
        )  # fmt: skip


def _is_marked(out: Path, names: Sequence[str]) -> bool:
    """Whether a folder has the listing of a command, or the note of one that was killed."""
    from sgp_ros.report.files import was_cut_off  # noqa: PLC0415 - it takes time

    listings = [name for name in names if name.startswith(_LISTING) and name.endswith('.json')]
    return any(stat.S_ISREG((out / name).lstat().st_mode) for name in listings) or was_cut_off(out)


def require_own_recording(table: str, out: Path) -> None:
    """Refuse to import a table over a recording that no import of it wrote.

    Args:
        table: that is imported.
        out: folder, or path of the recording.

    Raises:
        ConfigError: such a recording is there.
    """
    path = out if out.suffix == '.mcap' else out / f'{Path(table).stem}.mcap'
    if path.exists() and path.name not in _imported(path.parent):
        raise ConfigError(
            f'{path} exists and was not written by sgp import', 'a new name',
            'choose another --out, or add --force',
        )  # fmt: skip


def imports_of(path: Path) -> str:
    """Return the name under which the files of an imported recording are listed beside it."""
    return f'{BESIDE_INPUT}_{path.stem}'


def _imported(folder: Path) -> set[str]:
    """Return the names of imported files in a folder, and of their listings."""
    from sgp_ros.strangers import read_text  # noqa: PLC0415 - it takes time

    found = set()
    for listing in folder.glob(f'{_IMPORTS}*.json'):
        with suppress(SgpError, OSError, ValueError, TypeError):
            found |= {listing.name, *json.loads(read_text(listing))}
    return found


def mark_folder(out: Path, command: str) -> None:
    """Leave a sign in a folder that a command of ours wrote there, where it left none itself.

    What runs that were killed have left there is removed.
    """
    if out.is_dir():
        from sgp_ros.strangers import remove_growing, replace_file  # noqa: PLC0415 - as above

        remove_growing(out)
        listing = out / f'{_LISTING}{command}.json'
        if not listing.exists():
            replace_file(listing, lambda stream: stream.write(b'{}\n'))


def _coloured(text: str, code: str) -> str:
    wants = sys.stdout.isatty() and not os.environ.get('NO_COLOR')
    wants = wants and os.environ.get('TERM') != 'dumb'
    return f'\033[{code}m{text}\033[0m' if wants else text
