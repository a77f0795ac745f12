"""Z beside the physics: it stays only where predictions are no worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.locate.remainder import learn_remainder
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.prove.processes import harm, kept_processes
from sgp_ros.diagnosis.result import Proof
from test.diagnosis.worlds import CHAINS, simulate

STIFFNESS = 3.0


def _force(q):
    return -STIFFNESS * np.sin(2.0 * q)


@pytest.fixture(scope='module')
def equations(equations_for):
    world = simulate(CHAINS[1], 7, 6.0, force=lambda t, q, v: (_force(q[0]),))
    return equations_for(world)[1]


def _final(equations, residual):
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    model = fit(Columns(equations), (), start, is_free=False)
    found = learn_remainder(equations, residual, 0)
    assert found is not None
    return FinalModel(model, model, equations, (found,))


def test_a_process_that_predicts_the_motion_stays(equations):
    final = _final(equations, equations.d)
    assert kept_processes(final) == (final.remainders, ())


def test_a_process_that_harms_roll_outs_is_dropped_with_a_word(equations):
    """Learned from a residual that the motion contradicts: the same force, the wrong way."""
    kept, (remark,) = kept_processes(_final(equations, -equations.d))
    assert kept == ()
    assert 'Z of joint0 was dropped' in remark
    assert kept_processes(FinalModel(*[None] * 3, ())) == ((), ())


def test_physics_that_a_constant_beats_is_no_yardstick(equations):
    """The same process stays where physics leaves more of the effort than varies of it."""
    final = _final(equations, -equations.d)
    far = replace(
        final.model, residual=100.0 * equations.motion.effort.std() + final.model.residual
    )
    kept, remarks = kept_processes(replace(final, model=far))
    assert (kept, remarks) == (final.remainders, ())


def test_a_process_without_rows_does_not_know_them(equations):
    """Its mean far from what it saw goes to what no data say."""
    (whole,) = _final(equations, equations.d).remainders
    nothing = whole.without(np.arange(len(equations.d)) > 0)
    left = nothing.force(equations.motion) - _force(equations.motion.position[:, 0])
    knows = whole.force(equations.motion) - _force(equations.motion.position[:, 0])
    assert np.mean(left**2) > 10.0 * np.mean(knows**2)


def test_harm_on_what_was_held_out_is_said(equations):
    remainders = _final(equations, equations.d).remainders

    def proof(effort, rollout):
        names = {'joint0': 1.0}
        return Proof(names, {'joint0': effort}, names, names, 0.0, 0.0, names, {'joint0': rollout})

    before = {'far': proof(0.2, 0.1)}
    assert harm(remainders, ('joint0',), before, {'far': proof(0.1, 0.1)}) == ()
    (said,) = harm(remainders, ('joint0',), before, {'far': proof(0.1, 0.4)})
    assert said.startswith(
        'Z of joint0 makes predictions worse in far: the nMSE of its roll-outs is 0.4,'
    )
    assert said.endswith('with the physics alone 0.1.')
