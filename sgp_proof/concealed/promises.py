"""What a diagnosis promises and what `sgp replay` delivers with the robot that it leaves.

    python -m sgp_proof.concealed.promises CASES DIAGNOSES [--out FILE]

For every case the training recording runs through the online engine with `robot_diagnosed.yaml`,
and the nMSE of the effort stands beside the one of the diagnosis, with their ratio. Effects that
are not modelled online, and joints that dry friction holds at rest, are remarked.
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.apps.replay import run_replay

_NAMES = ('promised', 'delivered')


def promised_and_delivered(
    recording: Path, diagnosis: Path
) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """Return both nMSE of the effort by joint, and the remarks of the replay.

    Args:
        recording: that was diagnosed.
        diagnosis: folder with diagnosis.json and robot_diagnosed.yaml.
    """
    content = json.loads((diagnosis / 'diagnosis.json').read_text(encoding='utf-8'))
    robot = str(diagnosis / 'robot_diagnosed.yaml')
    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(io.StringIO()):
        metrics = run_replay(str(recording), robot, Path(out), progress=lambda _: None)
    found = {
        joint: (promised, metrics['joints'][joint]['effort']['nmse'])
        for joint, promised in content['fit']['train']['nmse_after'].items()
        if 'effort' in metrics['joints'][joint]  # a passive joint has none
    }
    return found, metrics['remarks']


def main() -> None:
    """Print one line a joint, and write the result."""
    parser = make_parser(__doc__, 'promises')
    parser.add_argument('cases', type=Path, help='folder of folders with real.mcap')
    parser.add_argument('diagnoses', type=Path, help='folder of the results of sgp diagnose')
    arguments = parser.parse_args()
    results = {}
    for case in sorted(arguments.cases.iterdir()):
        found, remarks = promised_and_delivered(
            case / 'real.mcap', arguments.diagnoses / case.name
        )
        for joint, (promised, delivered) in found.items():
            ratio = delivered / promised
            print(f'{case.name} {joint}: {promised:.2g} promised, {delivered:.2g}, x {ratio:.1f}')
        for remark in remarks:
            print(f'    {remark}')
        joints = {joint: dict(zip(_NAMES, pair, strict=True)) for joint, pair in found.items()}
        results[case.name] = {'effort_nmse': joints, 'remarks': remarks}
    write_result(arguments.out, {'cases': results})


if __name__ == '__main__':
    main()
