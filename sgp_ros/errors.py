"""Exceptions that a user, a message or a recording can cause.

Each says in one line what was found, what was expected and what to do, and carries these three
as attributes, so that a command can print them as they are.
"""

from __future__ import annotations

import re

_ENDLESS = re.compile(r'(\S{80})(\S{920,})')
"""A word that only a damaged file has, longer than a path: its beginning and the rest."""


class SgpError(Exception):
    """Base of every error raised on purpose.

    Args:
        found: what was there, with the place (file, topic, joint, setting).
        expected: what should have been there.
        remedy: what the user can do about it; may be empty.
    """

    def __init__(self, found: str, expected: str = '', remedy: str = '') -> None:
        self.found = found
        self.expected = expected
        self.remedy = remedy
        parts = [found]
        if expected:
            parts.append(f'expected {expected}')
        if remedy:
            parts.append(remedy)
        text = '; '.join(parts).replace('\n', ' ')
        super().__init__(_ENDLESS.sub(lambda m: f'{m[1]}... ({len(m[0])} characters)', text))

    def __reduce__(self) -> tuple[type[SgpError], tuple[str, str, str]]:
        """Keep the three parts when the error crosses a process boundary."""
        return type(self), (self.found, self.expected, self.remedy)


class ConfigError(SgpError):
    """A setting, robot file or map has a wrong key, type or value."""


class MessageError(SgpError):
    """A message cannot be turned into a sample."""


class RecordingError(SgpError):
    """A recording is missing, unreadable or lacks what is needed."""


class NumericalError(SgpError):
    """A computation lost its meaning, such as a factor that is not positive definite."""
