"""Signals and dependences that a diagnosis shows in pictures and files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.diagnosis.criteria import SIGNIFICANT


@dataclass(frozen=True, slots=True)
class Dependence:
    """Variables that the discrepancy of a joint depends on.

    Attributes:
        joint: name.
        share: of the mean squared effort that the nominal robot leaves.
        scores: share of what is left that each variable explains on held-out stretches, by name.
        p_values: chance that a disturbance of the same spectra, which knows nothing of the
            motion, has a score as remarkable for any joint and variable, by name.
    """

    joint: str
    share: float
    scores: Mapping[str, float]
    p_values: Mapping[str, float] = field(default_factory=dict)

    def is_significant(self, variable: str) -> bool:
        """Return whether a variable explains something, and more than chance would."""
        return self.scores[variable] > 0.0 and self.p_values.get(variable, 1.0) <= SIGNIFICANT


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Z of one joint over one variable, backward and forward, at m values.

    Attributes:
        joint: name.
        variable: `position`, `velocity`, `effort` or `time`.
        x: (m,) values, in the units of the variable.
        mean: (m, 2) of Z, backward and forward [N m or N]; NaN where the joint never moved so.
        half: (m, 2) half width of the band that holds everywhere at once [N m or N].
        regions: intervals of x where the mean leaves the band.
        rows: share of the rows that lie in them.
    """

    joint: str
    variable: str
    x: np.ndarray
    mean: np.ndarray
    half: np.ndarray
    regions: tuple[tuple[float, float], ...]
    rows: float


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """Filtered signals of the training recording, for pictures.

    Attributes:
        time: (N,) [s].
        position, velocity, effort: (N, k).
        before: (N, k) what the nominal robot leaves of the effort [N m or N].
        parameters: (N, k) what wrong inertial parameters alone leave.
        after: (N, k) what the final model leaves.
        noise: (k,) expected from the encoders.
        forces: by finding, (N, k) force on each joint.
        moving: (N, k) where no dry friction holds the joint, and laws show.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    before: np.ndarray
    parameters: np.ndarray
    after: np.ndarray
    noise: np.ndarray
    forces: tuple[np.ndarray, ...]
    moving: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Accelerations that the final model predicts on a recording.

    Attributes:
        time: (n,) since the first state [s].
        acceleration: (n, k) [rad/s^2 or m/s^2].
    """

    time: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """Motion of a model under what was recorded.

    Attributes:
        position: (N, k), NaN where there is none, and once it has left for good [rad or m].
        rms: (k,) root mean square errors, NaN of a replay that is not stable [rad or m].
    """

    position: np.ndarray
    rms: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """Measured, nominal and diagnosed motion of one recording, N rows.

    Attributes:
        time: (N,) since the first state [s].
        position: (N, k) measured [rad or m].
        effort: (N, k) that acted, low-passed [N m or N].
        efforts: `nominal` and `diagnosed` to what they take for this motion, (N, k).
        replays: mode to the replays of both, see `prove.overlay`.
        seconds: length of the recording [s].
    """

    time: np.ndarray
    position: np.ndarray
    effort: np.ndarray
    efforts: Mapping[str, np.ndarray]
    replays: Mapping[str, Mapping[str, Replay]]
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class TriedFormula:
    """A formula of a force law that was fitted.

    Attributes:
        formula: `tau_x[J] = ...`.
        parameters: values with their units, by name.
        left: share of the mean squared effort of the joint that it leaves.
        words: the nearest known physics.
        curve: (s,) over the factor of the search at `seen_x` of it; NaN where it is a function
            of something else.
        beyond: (b,) the same at `beyond_x`.
        is_alike: whether the recording hardly tells it from the best one.
    """

    formula: str
    parameters: Mapping[str, tuple[float, str]]
    left: float
    words: str
    curve: np.ndarray
    beyond: np.ndarray
    is_alike: bool


@dataclass(frozen=True, slots=True, eq=False)
class LawSearch:
    """Result of the search for an unlisted law at a joint.

    Attributes:
        joint: name.
        variable: what the force depends on most, such as `dq[elbow]`.
        factor: that the shape is multiplied by, such as `sign(dq[elbow])`; empty for none.
        unit: of the variable.
        force_unit: of the shape.
        x: (p,) over the range that was seen.
        mean: (p,) shape without a formula.
        half: (p,) half the width of its 95 % band.
        left: share of the mean squared effort that the shape leaves.
        left_listed: the same of the best effects of the list.
        formulas: best first; the first is asserted where `why_not` is empty.
        why_not: why none is asserted.
        words: the shape as a sentence.
        seen_x: (s,) the variable in the recording, ascending.
        seen: (s,) the data there: the shape, and what is left over the factor.
        beyond_x: (b,) the variable, half as far again to either side.
    """

    joint: str
    variable: str
    factor: str
    unit: str
    force_unit: str
    x: np.ndarray
    mean: np.ndarray
    half: np.ndarray
    left: float
    left_listed: float
    formulas: tuple[TriedFormula, ...]
    why_not: str
    words: str
    seen_x: np.ndarray
    seen: np.ndarray
    beyond_x: np.ndarray
