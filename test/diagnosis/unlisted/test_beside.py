"""Which listed names a smooth force puts in question."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.unlisted.beside import is_bent, is_slight
from test.diagnosis.fitted_models import fitted


@pytest.fixture(scope='module')
def damped(equations_for, viscous):
    return equations_for(viscous)[1]


def _with_rest(model, share):
    """The same model with a residual that is more by a share of the mean squared effort."""
    power = model.frame.equations.power
    return replace(model, residual=model.residual + (share * power) ** 0.5)


def test_only_laws_whose_place_a_smooth_force_takes_are_in_question(damped):
    smooth = fitted(damped, 'cogging', 'viscous_friction')
    listed = _with_rest(smooth, 0.5 * COUNTED_SHARE)
    without = fitted(damped, 'viscous_friction')
    assert is_slight(listed, smooth, 0)
    assert not is_slight(listed, replace(without, residual=smooth.residual), 0)
    assert not is_slight(_with_rest(smooth, 2.0 * COUNTED_SHARE), smooth, 0)
    assert not is_bent(listed, smooth, 0)
