"""Recordings with the models that were compared on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis import connected
from sgp_ros.diagnosis.compare.volume import Loop
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.criteria import PER_EFFECT, STATED_ERROR
from sgp_ros.diagnosis.gathered import Knowledge, Recordings, gather
from sgp_ros.diagnosis.result import Finding, Location
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.unknowns import Agreement
from sgp_ros.physics.catalogue import ARMATURE
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo
from sgp_ros.robots.gains import Gains
from test.diagnosis.worlds import CHAINS, events_of, heavier, simulate


@dataclass(frozen=True)
class _AsGiven:
    """A scale on which models are worth what they say."""

    nominal: float = 0.0
    power: float = 0.0
    carried: float = 1.0

    def worth(self, model):
        return model.worth


@dataclass(frozen=True)
class _Driven:
    gains: Gains


def test_an_error_has_to_explain_more_than_the_best_model_that_is_not_asserted(monkeypatch):
    """An absurd mount of the base leaves less than nothing does; rotor and friction do so too.

    The nearest model counts only if it explains most: a payload that stops the robot does not.
    """
    monkeypatch.setattr(connected, 'Scale', SimpleNamespace(of=lambda *_: _AsGiven()))

    def worth(nearest):
        base = SimpleNamespace(worth=70.0, left=np.array([0.9, 0.01]))
        decision = SimpleNamespace(model=nearest or base, tentative=nearest)
        several = SimpleNamespace(decision=decision, comparison=SimpleNamespace(base=base))
        equations = SimpleNamespace(motion=SimpleNamespace(has_all_efforts=False))
        return Connected(None, equations, several).worth(0.0, 0.0)

    assert worth(None) == 70.0
    assert worth(SimpleNamespace(worth=217.0, left=np.array([0.1, 0.1]))) == 217.0
    assert worth(SimpleNamespace(worth=217.0, left=np.array([0.5, 0.1]))) == 70.0


@dataclass(frozen=True)
class _OfEfforts(_AsGiven):
    """A scale that is worth minus the errors in units of efforts as they were recorded."""

    def worth(self, model):
        assert self.carried == 0.0
        return float((model.inertia - 0.5 * np.log(model.mean_square / self.power)).sum())


@dataclass(frozen=True)
class _Residual:
    """A residual, and how much of the efforts the motors deliver."""

    mean_square: np.ndarray
    delivered: np.ndarray
    inertia: np.ndarray
    worth: float = 0.0


def test_recorded_efforts_in_any_unit_are_explained_alike(monkeypatch):
    """Ten times the unit, ten times the error; a heavier model gains nothing by its inertia."""
    monkeypatch.setattr(connected, 'Scale', SimpleNamespace(of=lambda *_: _OfEfforts()))
    equations = SimpleNamespace(motion=SimpleNamespace(has_all_efforts=True))
    square, recorded = np.array([4.0, 1.0]), np.array([100.0, 100.0])

    def worth(square, factor, delivered=1.0, inertia=0.0):
        model = _Residual(square, np.log(np.full(2, delivered)), np.full(2, inertia))
        decision = SimpleNamespace(model=model, tentative=None)
        several = SimpleNamespace(decision=decision, comparison=SimpleNamespace(base=model))
        done = replace(Correction.none(2), effort_scale=np.full(2, factor))
        return Connected(None, equations, several, done).worth(0.0, recorded)

    plain = worth(square, 1.0)
    assert worth(square / 100.0, 10.0) == pytest.approx(plain)
    assert worth(square, 1.0, inertia=3.0) == plain
    assert worth(square / 4.0, 1.0, delivered=0.5) == pytest.approx(plain)


@dataclass(frozen=True)
class _OfMotion(_AsGiven):
    """A scale of the motion whose floor is a share of the efforts, larger beyond their inertia."""

    def worth(self, model):
        floor = 1e-5 * np.exp(2.0 * (model.inertia - self.carried))
        share = model.mean_square / self.power + floor
        return float((model.inertia - 0.5 * np.log(share)).sum())


@pytest.mark.parametrize('noise_part', [0.0, 1.0])
def test_a_unit_moves_as_bodies_that_are_as_much_heavier_do(monkeypatch, noise_part):
    """Efforts in mN m: neither fits the motion better, also where next to nothing is left."""
    size, recorded = np.full(2, np.log(1000.0)), np.array([1e8, 4e6])

    def worth(model, carried, factor):
        scale = _OfMotion(carried=carried)
        monkeypatch.setattr(connected, 'Scale', SimpleNamespace(of=lambda *_: scale))
        equations = SimpleNamespace(
            motion=SimpleNamespace(has_all_efforts=True), noise_part=np.full(2, noise_part),
            loop=SimpleNamespace(volume=lambda *_: np.zeros(2)),
        )  # fmt: skip
        decision = SimpleNamespace(model=model, tentative=None)
        several = SimpleNamespace(decision=decision, comparison=SimpleNamespace(base=model))
        done = replace(Correction.none(2), effort_scale=np.full(2, factor)) if factor else None
        return Connected(None, equations, several, done).worth(0.0, recorded, is_of_motion=True)

    left = 1e-6 * recorded
    heavier = worth(_Residual(left, np.zeros(2), size), size, None)
    assert worth(_Residual(left / 1e6, np.zeros(2), 0.0 * size), 0.0, 1e3) == pytest.approx(
        heavier
    )


@pytest.mark.parametrize('scale', [0.3, 3.0])
def test_another_unit_of_positions_is_no_prize_where_a_drive_is_stiff(monkeypatch, scale):
    """Its gains, in the unit of what was recorded, make its motion; of given efforts it is one."""
    monkeypatch.setattr(connected, 'Scale', SimpleNamespace(of=lambda *_: _OfMotion(carried=0.0)))
    omega, one = np.linspace(1.0, 30.0, 16), np.ones(1)

    def worth(gain, done):
        size = 1.0 if done is None else float(done.scale[0])
        loop = Loop(one, gain * size * one, 0.0 * one, omega)
        model = _Residual(1e-3 * one, 0.0 * one, 0.0 * one)
        equations = SimpleNamespace(
            motion=SimpleNamespace(has_all_efforts=False), noise_part=0.0 * one, loop=loop
        )
        decision = SimpleNamespace(model=model, tentative=None)
        several = SimpleNamespace(decision=decision, comparison=SimpleNamespace(base=model))
        return Connected(None, equations, several, done).worth(0.0, one)

    done = replace(Correction.none(1), scale=scale * one)
    assert worth(1e5, done) == pytest.approx(worth(1e5, None), abs=0.05)
    assert worth(0.0, done) == pytest.approx(worth(0.0, None) - np.log(scale), abs=0.05)


@pytest.mark.parametrize(('factor', 'accuracy'), [(1.03, STATED_ERROR), (1.6, 1.0)])
def test_a_file_is_as_accurate_as_the_recording_says(robots, factor, accuracy):
    """Beside friction: its bodies are a few per cent off, or one of them is another one."""
    robot, tree = robots[2]
    chain = heavier(heavier(CHAINS[2], 0, 1.02), 1, factor)
    world = simulate(chain, 3, 20.0, force=lambda _t, _q, v: tuple(-0.3 * x for x in v))
    known = Knowledge(robot, (), USUAL)
    recordings = gather({'': events_of(world)}, {}, tree, known, holds_out=False)
    of = connected.equations_of(recordings, tree)
    assert of(recordings.learned).accuracy == accuracy


@pytest.mark.parametrize('share', [0.5, 2.0])
def test_an_agreement_leaves_less_by_what_is_left_of_all_efforts(share):
    shares = np.array([[0.1, 0.2], [0.1, 0.2 * share]])
    one, two = (Agreement(0.0, 2, *[np.zeros(2)] * 3, x, 100.0, np.zeros(2)) for x in shares)
    assert two.leaves_less(one) is (share < 1.0)


def test_what_is_found_with_an_error_of_the_connection_too_is_as_certain():
    """Efforts in another unit or heavier bodies: either way there is friction."""
    beside = Connected(
        None, None, None, rivals=('all',), trust=0.5, common=frozenset({('spring', 'knee')})
    )
    friction = Finding('knee', 'viscous_friction', {}, Location(), 9.0, 0.9, 1.0)
    assert beside.against_rivals(friction).probability == pytest.approx(0.45)
    assert beside.against_rivals(replace(friction, effect='spring')).probability == 0.9
    elsewhere = replace(friction, effect='spring', joint='hip')
    assert beside.against_rivals(elsewhere).probability == pytest.approx(0.45)


@pytest.mark.parametrize(
    ('offset', 'undone', 'is_alike'),
    [
        (0.0, {}, True),
        (0.0, {'effort_scale': -1.0}, False),
        pytest.param(0.4, {'offset': 0.4}, False, marks=pytest.mark.long),
    ],
)
def test_a_correction_shows_with_the_laws_that_were_found(robots, offset, undone, is_alike):
    """Bodies that stood for an offset go with it; a sign that is right has no other."""
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 3, 20.0, force=lambda _t, _q, v: (-0.3 * v[0],))
    events = events_of(replace(world, position=world.position + offset))
    recordings = gather({'': events}, {}, tree, Knowledge(robot, (), USUAL), holds_out=False)
    plain = connected.compared(recordings, tree, lambda _: None)
    numbers = {name: np.array([x]) for name, x in undone.items()}
    found = connected.foreseen(plain, replace(Correction.none(1), **numbers), tree)
    nominal, power = np.minimum(plain.nominal, found.nominal), plain.equations.power
    gain = found.worth(nominal, power) - plain.worth(nominal, power)
    laws = [[s.name for s in x.several.decision.model.effects] for x in (plain, found)]
    if is_alike:
        assert laws == [['viscous_friction']] * 2
        assert gain == pytest.approx(0.0, abs=0.5)
    elif offset:
        assert laws[1] == ['viscous_friction']
        assert gain > PER_EFFECT
    else:
        assert gain < -100.0


@pytest.mark.parametrize(
    ('left', 'is_again'), [((0.01, 0.001), True), ((0.001, 0.01), False)]
)  # fmt: skip
def test_held_targets_meet_the_rotors_that_were_found(monkeypatch, left, is_again):
    """Their ripple follows from all inertia; recordings without one are compared once."""
    seen = []

    def compare(recordings, *_):
        rotors = recordings.learned.gains.rotors
        seen.append(None if rotors is None else rotors.tolist())
        model = SimpleNamespace(
            effects=(EffectAt(ARMATURE, Place(1), coefficients=np.array([0.3])),)
        )
        drive = Servo(None, 0.0, (0,), *[np.zeros(2)] * 5, ripple=ripple)
        return SimpleNamespace(
            equations=SimpleNamespace(motion=SimpleNamespace(drive=drive), d=np.zeros((1, 2))),
            several=SimpleNamespace(decision=SimpleNamespace(tentative=None, model=model)),
            unexplained=np.array([left[len(seen) - 1]]),
        )

    ripple = None
    monkeypatch.setattr(connected, '_compared', compare)
    raw = _Driven(Gains(np.ones(2), np.ones(2)))
    recordings = Recordings(('a',), raw, {}, {}, (), ())
    connected.compared(recordings, None, None)
    assert seen == [None]
    ripple = object()
    seen.clear()
    found = connected.compared(recordings, None, None)
    assert seen == [None, [0.0, 0.3]]
    assert float(found.unexplained[0]) == left[is_again]
