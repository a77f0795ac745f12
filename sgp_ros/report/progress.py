"""A progress bar for commands that take a while."""

from __future__ import annotations

import sys


class Progress:
    """A progress bar on stderr, where that is a terminal.

    Args:
        name: of the command, in front of the bar.
    """

    _WIDTH = 40

    def __init__(self, name: str) -> None:
        self._name = name
        self._shown = -1

    def __call__(self, share: float) -> None:
        """Show that `share` of the work, 0 to 1, is done."""
        percent = int(100.0 * min(max(share, 0.0), 1.0))
        if percent == self._shown or not sys.stderr.isatty():
            return
        self._shown = percent
        filled = self._WIDTH * percent // 100
        bar = '#' * filled + '.' * (self._WIDTH - filled)
        end = '\n' if percent == 100 else ''
        sys.stderr.write(f'\rsgp {self._name} [{bar}] {percent:3d} %{end}')
        sys.stderr.flush()
