"""`sgp import`: a table of numbers becomes a recording."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from sgp_ros.apps.terminal import imports_of
from sgp_ros.batch.contradictions import require_units
from sgp_ros.recordings.imports import ImportSummary, import_table
from sgp_ros.recordings.table_entries import JointHint
from sgp_ros.report.files import replacing_results
from sgp_ros.report.next_steps import after_import, next_lines
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot


def run_import(
    table: str, out: Path, progress: Callable[[float], None], *, map_path: str | None = None,
    robot: str | None = None, rate: float | None = None, is_forced: bool = False,
    group: str | None = None,
) -> dict[str, object]:  # fmt: skip
    """Write a table as a recording, see `import_table`.

    Args:
        table: file.
        out: folder of the results.
        progress: called with the share that is done.
        map_path: YAML file that says what the columns are; None to guess it.
        robot: whose joints these are; None where that is not known.
        rate: of the rows of a table without times [Hz].
        is_forced: whether files that no import wrote are replaced.
        group: whose columns alone are read; None for all.

    Raises:
        ConfigError: such a file is in the way.
    """
    model = None if robot is None else load_robot(robot)
    stem = Path(table).stem if group is None else f'{Path(table).stem}_{group}'
    path = out if out.suffix == '.mcap' else out / f'{stem}.mcap'
    with replacing_results(path.parent, imports_of(path), keeps_others=not is_forced):
        summary = import_table(
            table, map_path, path, _hints(model), rate,
            lambda events: None if model is None else require_units(events, model), group,
        )  # fmt: skip
    progress(1.0)
    for remark in summary.remarks:
        sys.stderr.write(f'remark: {remark}\n')
    for said in summary.unsure:
        sys.stderr.write(f'unsure: {said}\n')
    print(f'{summary.samples} states of {", ".join(summary.joints)} in {summary.path}')
    print(_counts(summary))
    if summary.map_path is not None:
        print(
            f'the columns were guessed: check {summary.map_path}, correct it if needed, and pass '
            'it with --map'
        )
    if summary.gains_path is not None:
        print(f'gains of the drives in {summary.gains_path}')
    print(
        next_lines(
            after_import(summary.path, robot, summary.gains_path, has_poses=summary.has_poses)
        )
    )
    return summary.to_mapping()


def _hints(robot: Robot | None) -> list[JointHint]:
    if robot is None:
        return []
    return [
        JointHint(j.name, j.kind == 'prismatic', j.lower, j.upper, j.is_actuated)
        for j in robot.joints
    ]


def _counts(summary: ImportSummary) -> str:
    found = summary.quality
    missing = ', '.join(f'{count} of {name}' for name, count in found['missing'].items() if count)
    return (
        f'{found["rate_hz"]:.4g} Hz; {found["gaps"]} gaps, {found["backward"]} backward and '
        f'{found["repeated"]} repeated stamps; missing numbers: {missing or "none"}'
    )
