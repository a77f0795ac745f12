"""Differences between several recordings of one machine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.decide import differences
from sgp_ros.diagnosis.decide.each_alone import put_together
from sgp_ros.diagnosis.explain.in_recording import InRecording
from sgp_ros.physics.catalogue import EFFECTS, ENCODER_OFFSET
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place

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


@pytest.mark.parametrize(('law', 'may_be_common'), [(ENCODER_OFFSET, False),
                                                     (EFFECTS['spring'], True)])  # fmt: skip
def test_a_wrong_zero_of_one_recording_is_never_that_of_all(monkeypatch, law, may_be_common):
    """That would be an error of the connection, which was looked for before."""
    monkeypatch.setattr(differences._Search, 'fitted', lambda _self, _model, effects: effects)
    later = EffectAt(InRecording(law, 1), Place(0), coefficients=np.array([0.1]))
    shared = differences._Search(None, None, 2)._shared(
        SimpleNamespace(effects=(later,), key=frozenset({later.key}))
    )
    assert [s.effect for effects in shared for s in effects] == [law] * may_be_common


def _alone(*laws):
    """Return the model of a recording alone, of laws with their shares of the squared effort."""
    effects, shares = zip(*laws, strict=True)
    equations = SimpleNamespace(power=np.ones(1))
    forces = tuple(np.full((4, 1), share**0.5) for share in shares)
    frame = SimpleNamespace(equations=equations)
    return SimpleNamespace(effects=effects, forces=forces, frame=frame)


def test_models_of_each_recording_are_put_together():
    """Laws of most are common; what few have, or other numbers that count, act there alone."""
    dry, oil = 'coulomb_friction', 'viscous_friction'
    first = _alone((_at(dry, [1.0]), 0.2), (_at(oil, [0.5]), 0.1))
    same = _alone((_at(dry, [1.05]), 0.2), (_at(oil, [1.0]), 0.3))  # 0.05: 0.0005 of the effort
    loaded = _alone((_at(dry, [1.0]), 0.2), (_at('constant_load', [2.0]), 0.4))
    slight = _alone((_at(dry, [1.0]), 0.2), (_at('constant_load', [0.1]), 0.0009))
    found = put_together({0: first, 1: same, 2: loaded, 4: slight})
    said = [
        (s.effect.law.name, s.effect.recording) if isinstance(s.effect, InRecording)
        else (s.effect.name, None) for s in found
    ]  # fmt: skip
    assert said == [(dry, None), (oil, 0), (oil, 1), ('constant_load', 2)]
    assert found[0].coefficients == [1.0]
    found = put_together({0: first, 1: same})
    assert [s.effect.name for s in found] == [dry, oil, f'{oil} in 1']
    assert put_together({}) == ()


@pytest.mark.parametrize(('weight', 'force', 'evidence', 'holds'), [
    (0.0, 0.3, 99.0, True), (50.0, 0.3, 99.0, True), (0.0, 0.01, 99.0, False),
    (50.0, 0.01, 99.0, False), (0.0, 0.3, 1.0, False),
])  # fmt: skip
def test_a_difference_counts_beside_what_moves_the_robot(
    monkeypatch, weight, force, evidence, holds
):
    """A weight that is held makes the mean square of the effort large and says nothing."""
    rows = np.arange(400)
    effort = weight + np.sin(0.1 * rows)[:, None]
    equations = SimpleNamespace(
        power=(effort**2).mean(axis=0), filter=SimpleNamespace(rows=rows),
        motion=SimpleNamespace(effort=effort, recording=rows // 200),
    )  # fmt: skip
    monkeypatch.setattr(differences, 'support', lambda *_: np.array([evidence]))
    later = EffectAt(InRecording(EFFECTS['coulomb_friction'], 1), Place(0))
    model = SimpleNamespace(
        frame=SimpleNamespace(equations=equations), effects=(later,),
        forces=(np.where(rows < 200, 0.0, force)[:, None],),
    )  # fmt: skip
    scale = SimpleNamespace(floor=1e-5, power=1.0, rows=100.0)
    assert differences._Search(None, scale, 2)._holds(model) is holds


@dataclass(frozen=True)
class _Worth:
    """A model of so much worth."""

    name: str
    size: float
    score: float = 0.0
    is_real: bool = True

    def is_possible(self):
        return self.is_real


def test_a_difference_that_does_not_count_hides_no_other(monkeypatch):
    search = differences._Search(None, None, 2)
    models = {name: _Worth(name, size)
              for name, size in (('none', 0.0), ('slight', 9.0), ('clear', 5.0))}  # fmt: skip
    more = {'none': ['slight', 'clear']}
    fakes = {
        '_added': lambda _, m, _recording: [models[n] for n in more.get(m.name, [])],
        '_holds': lambda _, m: m.name == 'clear', 'possible': lambda _, m: m,
    }  # fmt: skip
    _fake(monkeypatch, **fakes)
    assert search.extended(models['none']) is models['clear']


def _fake(monkeypatch, **fakes):
    """Give the search these methods, and no others that try a model."""
    nothing = dict.fromkeys(('_added', '_moved', '_shared', '_simpler', '_fewer'), lambda *_: [])
    for name, fake in (nothing | {'worth': lambda _, m: m.size} | fakes).items():
        monkeypatch.setattr(differences._Search, name, fake)


def test_a_difference_is_tried_beside_the_plain_law_of_one_it_makes_impossible(monkeypatch):
    """Friction that took the load for its own is no reason to leave the load common."""
    none, plain = _Worth('none', 0.0), _Worth('plain', 5.0)
    driving = replace(_Worth('driving', 9.0), is_real=False)
    _fake(
        monkeypatch, _moved=lambda _, m: [driving] if m is none else [],
        possible=lambda _, m: plain if m is driving else m, _holds=lambda *_: True,
    )  # fmt: skip
    assert differences._Search(None, None, 2).extended(none) is plain


def test_a_law_of_one_recording_may_be_one_of_another(monkeypatch):
    monkeypatch.setattr(differences._Search, 'fitted', lambda _self, _model, effects: effects)
    dry, cold = _at('coulomb_friction', [1.0]), InRecording(EFFECTS['coulomb_friction'], 0)
    there = EffectAt(cold, Place(0), coefficients=np.array([0.3]))
    model = SimpleNamespace(effects=(dry, there), key=frozenset({dry.key, there.key}))
    found = {tuple(s.name for s in x) for x in differences._Search(None, None, 2)._moved(model)}
    name = dry.name
    assert (name, f'{name} in 1') in found  # less there instead of more here
    assert (f'{name} in 0', f'{name} in 1') in found
