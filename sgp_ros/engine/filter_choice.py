"""The filter of a stream: its windows, and before them their choice from the first seconds.

Noise of the encoder, white from state to state, becomes noise of the acceleration, the less the
longer the window; a longer window blurs what the joints do meanwhile. So the shortest window is
taken, no shorter than the default one, in which noise is a small enough share of the mean square
of every joint's acceleration. Position and measured velocity are compared by that noise: a coarse
velocity field is worse than the difference of good positions.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.held_commands import CommandHistory
from sgp_ros.engine.intake import State
from sgp_ros.engine.rest import white_variance
from sgp_ros.engine.samples import SettingValue
from sgp_ros.engine.weak_form import WeakForm
from sgp_ros.engine.windows import Equation, WindowFilter
from sgp_ros.robots.robot import Robot

TRIALS_S = (3.0, 6.0, 12.0)
"""Times after the first state at which the choice is made, the later ones where noise was too
large a share in every window, as while a robot stands still."""
WINDOWS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
"""Windows that are tried [s]."""
NOISE_SHARE = 5e-6
"""Most of the mean square of the acceleration that its noise may be."""
_SPACING_S = 0.05
_POINTS = 5
_MEDIAN_OF_SQUARE = 0.4549
"""Of a standard normal variable."""


class StateFilter:
    """Turns accepted states into equations of motion, once it is known in which windows.

    Attributes:
        windows: in force, or none yet.
        trial: what the filter is being chosen on; None while one is in force.
    """

    def __init__(self, robot: Robot, config: EngineConfig) -> None:
        self._robot, self._config = robot, config
        self.windows = WindowFilter(robot, config)
        self.trial = FilterTrial() if config.filter_window < 0.0 else None

    def take(
        self, state: State | None, commands: CommandHistory
    ) -> tuple[list[Equation], dict[str, SettingValue]]:
        """Return the equations that the next state completes, and the settings chosen with it.

        Args:
            state: None where one was refused: no window goes on.
            commands: of the recent past; what no window needs is forgotten.
        """
        if self.trial is not None:
            after_s = self.trial.add(state)
            if after_s is None:
                return [], {}
            chosen, is_good = self.trial.choose(self._config.filter_velocity)
            wait = not is_good and after_s < TRIALS_S[-1]
            return ([], {}) if wait else (self._begin(self.trial, chosen, commands), chosen)
        if state is not None:
            return self.windows.push(state, commands), {}
        self.windows.restart()
        if commands.stamps_ns:
            commands.forget_before(commands.stamps_ns[-1])
        return [], {}

    def begin_segment(self) -> None:
        """Begin anew, also a choice that is not made yet: what follows has another time."""
        self.windows.restart()
        if self.trial is not None:
            self.trial = FilterTrial()

    def finish(self, commands: CommandHistory) -> tuple[list[Equation], dict[str, SettingValue]]:
        """Return the same for the end of the stream."""
        if self.trial is None or not self.trial.states:
            return [], {}
        chosen, _ = self.trial.choose(self._config.filter_velocity)
        return self._begin(self.trial, chosen, commands), chosen

    def _begin(
        self, trial: FilterTrial, chosen: dict[str, SettingValue], commands: CommandHistory
    ) -> list[Equation]:
        config = self._config.changed(chosen, self._robot)
        self.windows, self.trial = WindowFilter(self._robot, config), None
        equations: list[Equation] = []
        for state in trial.states:
            if state is None:
                self.windows.restart()
            else:
                equations += self.windows.push(state, commands)
        return equations


class FilterTrial:
    """The states that a filter is chosen on.

    Attributes:
        states: accepted ones in order; None where one was refused: the next does not continue.
    """

    def __init__(self) -> None:
        self.states: list[State | None] = []
        self._stamps_ns: tuple[int, int] | None = None

    def add(self, state: State | None) -> float | None:
        """Take the next state; return which of `TRIALS_S` it completes [s], None without."""
        self.states.append(state)
        if state is None:
            return None
        first, last = self._stamps_ns or (state.stamp_ns, state.stamp_ns)
        self._stamps_ns = first, state.stamp_ns
        before, now = ((stamp - first) * 1e-9 for stamp in (last, state.stamp_ns))
        return next((t for t in reversed(TRIALS_S) if before < t <= now), None)

    def choose(self, velocity: str) -> tuple[dict[str, SettingValue], bool]:
        """Return the settings chosen, and whether noise is a small enough share with them.

        Args:
            velocity: the setting `filter.velocity`; `auto` is chosen too.
        """
        stretches = [s for s in self._stretches() if len(s) > _POINTS]
        sources = ['position', 'measured'] if velocity == 'auto' else [velocity]
        if not all(state.velocity is not None for stretch in stretches for state in stretch):
            sources = ['position']
        best = (np.inf, WINDOWS[0], velocity)
        for window in WINDOWS:
            found = [(_noise_share(stretches, source, window), window, source)
                     for source in sources]  # fmt: skip
            best = min(best, *found, key=lambda tried: tried[0])
            if best[0] <= NOISE_SHARE:
                break
        chosen: dict[str, SettingValue] = {'filter.window': best[1], 'filter.velocity': best[2]}
        return chosen, bool(best[0] <= NOISE_SHARE)

    def _stretches(self) -> list[list[State]]:
        found: list[list[State]] = [[]]
        for state in self.states:
            if state is None:
                found.append([])
            else:
                found[-1].append(state)
        return found


def _noise_share(stretches: list[list[State]], source: str, window: float) -> float:
    """Return the largest share that noise has in the mean square of a joint's acceleration."""
    noise, acceleration, gain = [], [], []
    for stretch in stretches:
        t = np.array([state.stamp_ns - stretch[0].stamp_ns for state in stretch]) * 1e-9
        x = np.array([s.position if source == 'position' else s.velocity for s in stretch])
        noise.append(white_variance(t, x))
        for centre in np.arange(t[0] + 0.5 * window, t[-1] - 0.5 * window, _SPACING_S):
            inside = np.abs(t - centre) <= 0.5 * window
            if inside.sum() < _POINTS:
                continue
            form = WeakForm.from_positions if source == 'position' else WeakForm.from_velocities
            weights = form(t[inside]).weights
            acceleration.append(weights @ x[inside])
            gain.append(weights @ weights)
    if not gain:
        return float('inf')
    variance = np.median(np.concatenate(noise), axis=0) / _MEDIAN_OF_SQUARE
    power = np.mean(np.square(acceleration), axis=0)
    moves = power > 0.0
    if not moves.any():
        return float('inf')
    return float((np.mean(gain) * variance[moves] / power[moves]).max())
