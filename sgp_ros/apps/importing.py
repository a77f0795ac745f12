"""`sgp import`: a table of numbers becomes a recording."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from sgp_ros.recordings.tables import import_table


def run_import(
    table: str, map_path: str, out: Path, progress: Callable[[float], None]
) -> dict[str, object]:
    """Write a table as a recording, see `import_table`."""
    summary = import_table(table, map_path, out)
    progress(1.0)
    for remark in summary.remarks:
        sys.stderr.write(f'remark: {remark}\n')
    print(f'{summary.samples} states of {", ".join(summary.joints)} in {summary.path}')
    return summary.to_mapping()
