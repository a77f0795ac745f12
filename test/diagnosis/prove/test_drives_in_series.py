"""A drive with a delay and a limit: fitted, screened and rolled out as one chain."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import first_scale
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.diagnosis.prove.rollouts import cut, roll_out
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.physics.place import Place
from test.diagnosis.worlds import CHAINS, delayed, simulate


def _at(name, shape):
    return EffectAt(EFFECTS[name], Place(0), np.array([shape]))


def _limited(delay, limit):
    late = delayed(delay)
    return lambda commands, t: tuple(np.clip(late(commands, t), -limit, limit))


@pytest.fixture(scope='module')
def limited(equations_for):
    """A pendulum whose drive is late and gives no more than a limit."""
    return equations_for(simulate(CHAINS[1], 7, 10.0, motor=_limited(0.04, 3.0)))[1]


def test_a_limit_behind_a_delay_is_fitted_with_both_numbers(limited):
    """Neither is exact without the other; the limit is screened beside the delay found."""
    columns, start = Columns(limited), first_scale(limited)
    late = fit(columns, (_at('command_delay', 0.03),), start, is_free=False)
    (_, found), *_ = screen(columns, late, [EFFECTS['saturation']])
    assert [s.name for s in found.before] == ['command_delay']
    model = fit(columns, (*late.effects, found), late.sigma, is_free=False, steps=30)
    numbers = {s.name: s.shape[0] for s in model.effects}
    assert numbers['command_delay'] == pytest.approx(0.04, rel=0.01)
    assert numbers['saturation'] == pytest.approx(3.0, rel=0.01)
    assert model.left[0] < 0.01 * late.left[0]


def test_a_limit_behind_a_delay_is_rolled_out(limited):
    """The windows end where the robot did."""
    drives = in_series((_at('command_delay', 0.04), _at('saturation', 3.0)))
    model = fit(Columns(limited), drives, first_scale(limited), is_free=False, still=2)
    windows = cut(limited.motion, 40)
    q, ends = roll_out(windows, model, limited)
    assert ends.all()
    assert windows.squared(q).sum() < 1e-3 * windows.held.sum()
