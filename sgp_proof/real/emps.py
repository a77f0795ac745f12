"""The EMPS axis: parameters beside the published ones, errors on both records.

python -m sgp_proof.real.emps
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path

from sgp_proof.real.recordings import imported
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.cli import main as sgp

PUBLISHED = {'M': 95.1089, 'Fv': 203.5034, 'Fc': 20.3935, 'offset': -3.1648}


def _run(*arguments):
    with contextlib.redirect_stdout(io.StringIO()) as said:
        status = sgp([str(a) for a in arguments])
    if status:
        raise SystemExit(said.getvalue())


def _metrics(folder):
    return json.loads((folder / 'metrics.json').read_text(encoding='utf-8'))


def main() -> None:
    """Import, replay, compare, and write the result."""
    arguments = make_parser(__doc__, 'emps').parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for record in ('emps_id', 'emps_val_pulses'):
            imported(f'emps/{record}.csv', 'emps', folder)
        learned, held_out = folder / 'learned', folder / 'held_out'
        robot = ('--robot', 'linear_axis')
        _run('replay', folder / 'emps_id.mcap', *robot, '--out', learned)
        _run(
            'replay', folder / 'emps_val_pulses.mcap', *robot, '--out', held_out,
            '--model', learned / 'model.npz', '--frozen',
        )  # fmt: skip
        one, other = _metrics(learned), _metrics(held_out)
    parameters = {}
    for p in one['parameters']:
        published = PUBLISHED[p['name']]
        parameters[p['name']] = {
            'value': p['value'], 'std': p['std'], 'unit': p['unit'], 'published': published,
            'relative_difference': p['value'] / published - 1.0,
            'published_inside_95': abs(p['value'] - published) <= 1.96 * p['std'],
        }  # fmt: skip
    result = {
        'parameters': parameters,
        'identification_record': _errors(one),
        'validation_record_frozen': _errors(other),
        'samples': {'identification': one['samples'], 'validation': other['samples']},
        'timing': one['timing'],
    }
    write_result(arguments.out, result)
    for name, p in parameters.items():
        print(
            f'{name:8s}{p["value"]:10.4f} +- {1.96 * p["std"]:.4f} {p["unit"]:8s}'
            f'published {p["published"]:10.4f}  {100 * p["relative_difference"]:+.2f} %  '
            f'inside: {p["published_inside_95"]}'
        )
    for record in ('identification_record', 'validation_record_frozen'):
        print(record, result[record])


def _errors(metrics):
    effort = metrics['joints']['axis']['effort']
    return {
        'inverse_nmse_physics': metrics['physics_alone']['axis']['effort']['nmse'],
        'inverse_nmse_with_z': effort['nmse'],
        'coverage95_with_z': effort['coverage95'],
        'n': effort['n'],
    }


if __name__ == '__main__':
    main()
