"""Accelerations that a diagnosis predicts, one CSV per held-out recording."""

from __future__ import annotations

from pathlib import Path

from sgp_ros.diagnosis.result import Diagnosis, Predictions
from sgp_ros.report.files import write_text


def write_predictions(folder: Path, found: Diagnosis) -> None:
    """Write `pred_<stem>.csv` for each held-out recording."""
    for stem, prediction in found.predictions.items():
        write_text(folder / f'pred_{stem}.csv', _table(found.joints, prediction))


def _table(joints: tuple[str, ...], prediction: Predictions) -> str:
    lines = [','.join(['t', *(f'ddq_{name}' for name in joints)])]
    for t, row in zip(prediction.time, prediction.acceleration, strict=True):
        lines.append(','.join([f'{t:.6f}', *(f'{x:.7g}' for x in row)]))
    return '\n'.join(lines) + '\n'
