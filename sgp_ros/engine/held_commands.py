"""Commands that hold until the next one, as far back as a window needs them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable

import numpy as np

from sgp_ros.engine.weak_form import WeakForm
from sgp_ros.physics.drive import WindowDrive

MOST_COMMANDS = 100_000
"""Commands that are kept at most; beyond, every second one is dropped. Without states none would
be forgotten."""


class CommandHistory:
    """Zero-order hold over commands: each holds until the next one.

    Args:
        memory_s: how long a command matters after the next one [s].

    Attributes:
        stamps_ns: times at which commands began [ns], increasing.
        efforts: one (k,) per command.
    """

    def __init__(self, memory_s: float = 0.0) -> None:
        self._memory_ns = round(memory_s * 1e9)
        self.stamps_ns: list[int] = []
        self.efforts: list[np.ndarray] = []

    def add(self, stamp_ns: int, effort: np.ndarray) -> None:
        """Let `effort` (k,) hold from `stamp_ns` on, which is not before the last one."""
        if self.stamps_ns and self.stamps_ns[-1] == stamp_ns:
            self.efforts[-1] = effort
            return
        self.stamps_ns.append(stamp_ns)
        self.efforts.append(effort)

    def clear(self) -> None:
        """Forget all commands."""
        self.stamps_ns, self.efforts = [], []

    def age_ns(self, stamp_ns: int) -> int | None:
        """Return how old the command in force at `stamp_ns` is [ns]; None without one."""
        index = bisect_right(self.stamps_ns, stamp_ns)
        return None if index == 0 else stamp_ns - self.stamps_ns[index - 1]

    def average(
        self,
        first_ns: int,
        last_ns: int,
        cumulative: Callable[[np.ndarray], np.ndarray],
        acting: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """Integrate the held commands against a kernel, exactly.

        Args:
            first_ns: start of the kernel's support, where a command is in force [ns].
            last_ns: its end [ns].
            cumulative: integral of the kernel from `first_ns` to times given in seconds after it.
            acting: from held commands (pieces, k) and the middles of their times (pieces,) [s
                after `first_ns`] to what acts; None for the commands themselves.

        Returns:
            (k,) [unit of the commands].
        """
        start = bisect_right(self.stamps_ns, first_ns) - 1
        stop = bisect_right(self.stamps_ns, last_ns)
        changes = [first_ns, *self.stamps_ns[start + 1 : stop], last_ns]
        seconds = np.array([stamp - first_ns for stamp in changes]) * 1e-9
        shares = np.diff(cumulative(seconds))  # (pieces,)
        held = np.array(self.efforts[start:stop])  # (pieces, k)
        if acting is not None:
            held = acting(held, 0.5 * (seconds[1:] + seconds[:-1]))
        return shares @ held

    def drive(self, first_ns: int, form: WeakForm) -> WindowDrive:
        """Return the commands as drives receive them, for the window that begins at `first_ns`."""
        offsets = [stamp - first_ns for stamp in self.stamps_ns]
        samples = form.times - form.times[0]
        return WindowDrive(
            np.array(offsets) * 1e-9, np.array(self.efforts), samples, form.left, form.right
        )

    def thin(self) -> None:
        """Drop every second command but the last."""
        del self.stamps_ns[-2::-2]
        del self.efforts[-2::-2]

    def forget_before(self, stamp_ns: int) -> None:
        """Drop commands that do not matter any more from `stamp_ns` on."""
        keep = max(bisect_right(self.stamps_ns, stamp_ns - self._memory_ns) - 1, 0)
        del self.stamps_ns[:keep]
        del self.efforts[:keep]
