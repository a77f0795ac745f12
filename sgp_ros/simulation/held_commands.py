"""Commands that hold until the next one, each channel behind its own delay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class HeldCommands:
    """Zero-order hold with a pure delay per channel; before the first command there is 0.

    Args:
        delays_ns: per channel, m of them [ns].
    """

    def __init__(self, delays_ns: Sequence[int]) -> None:
        self._delays_ns = tuple(delays_ns)
        self._entries: list[tuple[int, np.ndarray]] = []

    @property
    def latest(self) -> np.ndarray:
        """The command given last, (m,)."""
        return self._entries[-1][1] if self._entries else np.zeros(len(self._delays_ns))

    def hold(self, time_ns: int, command: np.ndarray) -> None:
        """Give a command (m,) that holds from `time_ns`, not earlier than the one before."""
        self._entries.append((time_ns, command))

    def arrived(self, time_ns: int) -> np.ndarray:
        """Return the command that is in force at `time_ns`, (m,); time never runs backwards."""
        oldest = time_ns - max(self._delays_ns, default=0)
        while len(self._entries) > 1 and self._entries[1][0] <= oldest:
            del self._entries[0]
        command = np.zeros(len(self._delays_ns))
        for channel, delay_ns in enumerate(self._delays_ns):
            for given_ns, values in self._entries:
                if given_ns + delay_ns <= time_ns:
                    command[channel] = values[channel]
        return command

    def switches(self, start_ns: int, end_ns: int) -> list[int]:
        """Return the times strictly between start and end at which the command changes [ns]."""
        times = {given + delay for given, _ in self._entries for delay in self._delays_ns}
        return sorted(time for time in times if start_ns < time < end_ns)
