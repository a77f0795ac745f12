"""The benchmark command: what it writes, with and without rivals."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_proof.bench.command import BENCHES, bench_tables, run_bench
from sgp_proof.bench.evidence import bench_evidence
from sgp_proof.bench.problem import draw_problem
from sgp_proof.bench.rivals import RIVALS
from sgp_proof.bench.step import memory_of, step_row
from sgp_ros.cli import main
from sgp_ros.errors import ConfigError

NOBODY = {'gpytorch': None, 'sklearn': None}
CONTRACT = {
    'n', 'outputs', 'inputs', 'step_ms', 'floor_ms', 'times_floor', 'times_faster_gpytorch',
    'times_faster_sklearn', 'allocations',
}  # fmt: skip


@pytest.mark.long
def test_a_row_of_the_step_has_what_is_promised():
    """Keys of the contract; what is not installed is null, and the tables say so."""
    row = step_row(20, 2, 3, NOBODY, 1)
    assert set(row) >= CONTRACT
    assert row['times_faster_gpytorch'] is None
    assert row['times_faster_sklearn'] is None
    assert row['times_floor'] == pytest.approx(row['step_ms'] / row['floor_ms'])
    json.dumps(row, allow_nan=False)
    assert 'not installed' in bench_tables({'machine': {}, 'step': [row]})


@pytest.mark.long
def test_a_step_leaves_nothing_allocated():
    """In the steady state memory does not grow; a work that keeps something is noticed."""
    assert step_row(20, 2, 3, NOBODY, 1)['allocations'] == 0
    kept = []
    assert memory_of(lambda: kept.append(np.zeros(3)), 50)['allocations'] >= 1


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    """One file for programs, one for people, the same as on the screen."""
    assert main(['bench', 'evidence', '--quick', '--out', str(tmp_path), '--json']) == 0
    result = json.loads((tmp_path / 'bench.json').read_text())
    printed = capsys.readouterr()
    assert json.loads(printed.out) == result
    assert (tmp_path / 'bench.md').read_text() in printed.err
    assert result['schema'] == 1
    assert result['machine']['numpy'] == np.__version__
    assert set(result) == {'schema', 'machine', 'evidence'}


def test_unknown_benchmarks_are_refused(tmp_path):
    """The message lists the names that exist."""
    with pytest.raises(ConfigError, match=', '.join(BENCHES)):
        run_bench(['stepp'], tmp_path, lambda share: None)


@pytest.mark.parametrize('name', [name for name, rival in RIVALS.items() if rival is not None])
def test_rivals_compute_the_same(name):
    """The evidence agrees to eight digits, so the same work is timed."""
    (row,) = bench_evidence({'rival': RIVALS[name]}, lambda share: None, is_quick=True)
    assert row['rival_difference'] < 1e-8 * abs(row['log_evidence']) + 1e-6
    assert row['fit_log_evidence'] >= row['rival_fit_log_evidence'] - 0.1


@pytest.mark.parametrize('outputs', [1, 2])
def test_worlds_are_functions_of_their_seed(outputs):
    """All rivals see the same numbers."""
    one, other = draw_problem(9, outputs, 3, 5), draw_problem(9, outputs, 3, 5)
    np.testing.assert_array_equal(one.y, other.y)
    assert one.F.shape == (9, outputs, 4 * outputs)
