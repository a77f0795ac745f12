"""Differences between several recordings of one machine."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from sgp_ros.diagnosis.decide import differences
from sgp_ros.diagnosis.explain.in_recording import InRecording
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Place

MOTION = SimpleNamespace(stated_number=lambda _number, _joint: 0.0)


def _model(*effects):
    return SimpleNamespace(
        effects=effects, frame=SimpleNamespace(equations=SimpleNamespace(motion=MOTION))
    )


def _at(name, numbers, joint=0):
    return EffectAt(EFFECTS[name], Place(joint), coefficients=np.array(numbers))


def test_common_laws_that_are_impossible_beside_differences_become_plain(monkeypatch):
    """A load taken up later is no common friction that drives one way; it would not be read."""

    def fitted(_self, _model_, effects):
        sizes = {'coulomb_friction': [17.0], 'armature': [3.4]}
        return _model(*(
            s if isinstance(s.effect, InRecording)
            else EffectAt(s.effect, s.place, coefficients=np.array(sizes[s.name])) for s in effects
        ))  # fmt: skip

    monkeypatch.setattr(differences._Search, 'fitted', fitted)
    search = differences._Search(None, None, 2)
    later = EffectAt(
        InRecording(EFFECTS['coulomb_friction'], 1), Place(0), coefficients=np.array([-3.0])
    )
    driving = _at('asymmetric_coulomb', [-20.3, 54.5])
    found = search.possible(_model(_at('armature', [3.4]), driving, later))
    assert {s.key for s in found.effects} == {
        ('coulomb_friction', Place(0)), ('armature', Place(0)), later.key,
    }  # fmt: skip
    assert all(s.is_possible(MOTION) for s in found.effects if s is not later)
    right = _model(_at('asymmetric_coulomb', [13.0, 21.0]), later)
    assert search.possible(right) is right
