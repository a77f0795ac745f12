"""Models with a right hash and wrong content are refused, or can be used."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.robustness.harmful_files import crafted_models
from sgp_proof.robustness.read_models import ROBOT, SETTINGS, taught, use_model
from sgp_ros.engine.snapshots import restored
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.model_files import save_model
from sgp_ros.robots.registry import load_robot

EACH = 5
"""One of so many is tried; a prime, so that all kinds are."""


@pytest.mark.long
def test_a_crafted_model_is_refused_in_one_line_or_goes_on(tmp_path):
    model, path, used = taught(), tmp_path / 'model.npz', 0
    restored(load_robot(ROBOT), model)
    for number, (what, crafted) in enumerate(crafted_models(model)):
        if number % EACH:
            continue
        save_model(path, crafted)
        refusal = _refusal(path)
        used += refusal is None
        assert '\n' not in (refusal or ''), what
    assert 0 < used < number / EACH / 2


def _refusal(path):
    try:
        use_model(path)
    except ConfigError as error:
        return str(error)
    return None


def test_a_model_with_a_sample_that_has_no_neighbour_is_read_back():
    """Its distance is infinite; no other number of a model may be."""
    robot, model = load_robot(ROBOT), taught({**SETTINGS, 'buffer.policy': 'coverage'})
    (name,) = (n for n in model if n.endswith('_gap'))
    assert restored(robot, {**model, name: np.full_like(model[name], np.inf)}).is_ready
    with pytest.raises(ConfigError, match='gap'):
        restored(robot, {**model, name: np.full_like(model[name], np.nan)})
