"""Error promised by a diagnosis, beside that of `sgp replay` with the diagnosed robot.

    python -m sgp_proof.concealed.promises CASES DIAGNOSES [--out FILE]

For every case the training recording runs through the online engine with `robot_diagnosed.yaml`,
and the nMSE of the effort stands beside the one of the diagnosis, and beside what it promises of a
node: the same, or what it says where a node does not take over all that was found.
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.apps.replay import run_replay

FACTOR = 2.0
"""By which what is delivered may exceed what was promised."""


def promised_and_delivered(recording: Path, diagnosis: Path) -> dict[str, Any]:
    """Return the nMSE of the effort by joint, findings that are left out, and remarks.

    Args:
        recording: that was diagnosed.
        diagnosis: folder with diagnosis.json and robot_diagnosed.yaml.
    """
    content = json.loads((diagnosis / 'diagnosis.json').read_text(encoding='utf-8'))
    robot = str(diagnosis / 'robot_diagnosed.yaml')
    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(io.StringIO()):
        metrics = run_replay(str(recording), robot, Path(out), progress=lambda _: None)
    online = content.get('online', {'left_out': [], 'effort_nmse': {}})
    joints = {
        joint: {
            'diagnosed': diagnosed,
            'promised': online['effort_nmse'].get(joint, diagnosed),
            'delivered': metrics['joints'][joint]['effort']['nmse'],
        }
        for joint, diagnosed in content['fit']['train']['nmse_after'].items()
        if 'effort' in metrics['joints'][joint]  # a passive joint has none
    }
    return {
        'effort_nmse': joints, 'left_out': online['left_out'], 'remarks': metrics['remarks']
    }  # fmt: skip


def main() -> None:
    """Print one line a joint, and write the result."""
    parser = make_parser(__doc__, 'promises')
    parser.add_argument('cases', type=Path, help='folder of folders with real.mcap')
    parser.add_argument('diagnoses', type=Path, help='folder of the results of sgp diagnose')
    arguments = parser.parse_args()
    results = {}
    for case in sorted(arguments.cases.iterdir()):
        found = promised_and_delivered(case / 'real.mcap', arguments.diagnoses / case.name)
        for joint, x in found['effort_nmse'].items():
            ratio = x['delivered'] / x['promised']
            print(
                f'{case.name} {joint}: {x["diagnosed"]:.2g} diagnosed, {x["promised"]:.2g} '
                f'promised, {x["delivered"]:.2g} delivered, x {ratio:.2g}', flush=True,
            )  # fmt: skip
        for remark in found['remarks']:
            print(f'    {remark}')
        results[case.name] = found
    write_result(arguments.out, {'cases': results})


if __name__ == '__main__':
    main()
