"""Curves of a diagnosis that its figures and the charts of its page share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.result import Diagnosis, Finding
from sgp_ros.physics.catalogue import drawn_over, exerts_force
from sgp_ros.report.diagnosis_maps import effort_scale, position_unit, shown_position

_ZOOM_S = 4.0
_GAP = 1.5
"""Sampling periods from which on no line joins two rows."""


@dataclass(frozen=True, slots=True, eq=False)
class LawCurve:
    """The force of a finding over what it depends on, beside the data, n points.

    Attributes:
        joint: its index.
        x: (n,) abscissa, in any order.
        label: of the abscissa, with unit.
        law, measured: (n,) [N m or N].
        is_line: whether x is time, and neighbours are joined.
    """

    joint: int
    x: np.ndarray
    label: str
    law: np.ndarray
    measured: np.ndarray
    is_line: bool


def law_curve(found: Diagnosis, finding: Finding, force: np.ndarray) -> LawCurve:
    """Return the law of a finding with force (N, k), and the data beside it.

    What friction takes up while it holds the joint is not there to be drawn: NaN.
    """
    j = _strongest(found, finding, force)
    x, label = abscissa(found, finding, j)
    moving = found.traces.moving[:, j]
    law = np.where(moving | ~moving.any(), force[:, j], np.nan)
    measured = found.traces.after[:, j] + law
    over = drawn_over(finding.effect, finding.formula)
    if over == 'seconds':
        shown = zoomed(found, j)
        x, law, measured = (y[shown] for y in (x, broken(found, law), broken(found, measured)))
    elif over == 'time':
        law, measured = np.abs(law), np.abs(measured)
    return LawCurve(j, x, label, law, measured, over == 'seconds')


def broken(found: Diagnosis, values: np.ndarray) -> np.ndarray:
    """Return values (N,) of the traces with NaN where a line is to break."""
    return with_gaps(found.traces.time, values, found.rate_hz)


def with_gaps(time: np.ndarray, values: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return values (N,) with NaN in the last row before a gap in time (N,)."""
    step = np.diff(time, append=time[-1])
    return np.where(step > _GAP / rate_hz, np.nan, values)


def acting(found: Diagnosis, j: int) -> list[tuple[Finding, np.ndarray]]:
    """Return the findings that exert a force on a joint, with these, (N, k)."""
    return [(f, force) for f, force in forces_of(found) if np.abs(force[:, j]).max() > 0.0]


def forces_of(found: Diagnosis) -> list[tuple[Finding, np.ndarray]]:
    """Return the findings that exert forces, with these."""
    pairs = zip(found.findings, found.traces.forces, strict=False)
    return [(f, x) for f, x in pairs if exerts_force(f.effect)]


def _strongest(found: Diagnosis, finding: Finding, force: np.ndarray) -> int:
    if finding.joint in found.joints:
        return found.joints.index(finding.joint)
    return int(np.argmax((force**2).mean(axis=0) / effort_scale(found) ** 2))


def abscissa(
    found: Diagnosis, finding: Finding, j: int, name: str | None = None
) -> tuple[np.ndarray, str]:
    """Return a variable of joint j, (N,), and its label; None is that of the finding."""
    name = name or drawn_over(finding.effect, finding.formula)
    unit = position_unit(found, j)
    traces = found.traces
    words = {key: p.value for key, p in finding.parameters.items()}
    if words.get('kind') == 'torque' and words.get('source_joint') in found.joints:
        source = found.joints.index(str(words['source_joint']))
        return traces.effort[:, source], f'effort of {found.joints[source]}'
    curves = {
        'time': (traces.time, 'time [s]'),
        'seconds': (traces.time, 'time [s]'),
        'velocity': (traces.velocity[:, j], f'velocity [{unit}/s]'),
        'effort': (traces.effort[:, j], f'commanded effort [{found.units[j]}]'),
        'acceleration': (
            np.gradient(traces.velocity[:, j], traces.time), f'acceleration [{unit}/s^2]',
        ),
        'position': (shown_position(found, j), f'position [{unit}]'),
    }  # fmt: skip
    return curves[name]


def zoomed(found: Diagnosis, j: int) -> slice:
    """Return the rows of the few seconds in which the nominal robot leaves most."""
    length = int(np.clip(_ZOOM_S * found.rate_hz, 2, len(found.traces.time)))
    energy = np.convolve(found.traces.before[:, j] ** 2, np.ones(length), 'valid')
    first = int(np.argmax(energy))
    return slice(first, first + length)


def leading(scores: Mapping[str, float]) -> str:
    """Return the variable of a joint's own motion that explains most of a discrepancy."""
    own = [name for name in ('position', 'velocity', 'effort') if name in scores]
    return max(own, key=lambda name: scores[name])
