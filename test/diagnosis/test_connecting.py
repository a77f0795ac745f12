"""Comparisons before an error of the connection is asserted."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import connecting
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.connecting import in_halves
from sgp_ros.diagnosis.criteria import ALIKE, PER_EFFECT, TEMPER
from sgp_ros.diagnosis.setup.connection import Connection, Tried
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.physics.catalogue import TORQUE_GAIN
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place


def _of(cutoff, verdict='missing_physics'):
    """Return what a comparison up to a cut-off [Hz] returns, as far as it is asked."""
    decision = SimpleNamespace(verdict=verdict, unknown=(), tentative=None, model=None)
    several = SimpleNamespace(decision=decision)
    recordings = SimpleNamespace(
        remarks=(), corrected=lambda _c: None, learned=SimpleNamespace(gains=None)
    )
    return Connected(recordings, SimpleNamespace(filter=SimpleNamespace(cutoff=cutoff)), several)


def _found(monkeypatch, compare, numbers):
    """Return an error of the connection that is worth its price, with what compares recordings."""
    for name, stub in {
        'compared': compare, '_gain': lambda *_: 100.0, 'foreseen': lambda *_: None,
        'error_finding': lambda *_: SimpleNamespace(probability=0.99),
        'equal_errors': lambda _: (), '_stands_for_gains': lambda *_: False,
        'setup_advice': lambda _: 'advice', 'refined': lambda found, *_: (found, False),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    hypothesis = SimpleNamespace(effect='', joint='', names=numbers, is_of_gains=False)
    correction = SimpleNamespace(tree=lambda tree: tree)
    error = SimpleNamespace(
        correction=correction, numbers=numbers, remedy='', hypothesis=hypothesis
    )
    return Connection((error,), ((),), None, None)


@pytest.mark.parametrize('verdict', ['missing_physics', 'unexplained'])
@pytest.mark.parametrize(('numbers', 'is_asserted'), [((), True), ((0.02,), False)])
def test_something_unknown_beside_it_hides_no_error_without_numbers(
    monkeypatch, verdict, numbers, is_asserted
):
    """A reversed joint imitates no unknown law; an offset may, and is advice beside it."""
    found = _found(monkeypatch, lambda *_: _of(10.0, 'unexplained'), numbers)
    each = in_halves(lambda _: None)
    said = connecting._connected(_of(10.0, verdict), found, None, each)
    assert len(said.findings) == is_asserted
    assert ('advice' in said.remarks) is (verdict == 'unexplained' and not is_asserted)


@pytest.mark.parametrize(('plain', 'corrected', 'times'), [(25.0, 25.0, 1), (25.0, 9.0, 2)])
def test_a_band_is_compared_once(monkeypatch, plain, corrected, times):
    """As it is the recording is compared anew only where its correction has a lower cut-off."""
    compared = []

    def compare(_recordings, _tree, _progress, most_hz=corrected):
        compared.append(most_hz)
        return _of(most_hz)

    found = _found(monkeypatch, compare, ())
    each = in_halves(lambda _: None)
    correction = found.errors[0].correction
    assert connecting._connected(_of(plain), found, None, each).correction is correction
    assert len(compared) == times
    assert compared[-1] == corrected


@pytest.mark.parametrize(
    ('verdict', 'gain', 'is_compared'),
    [('missing_physics', -1.0 - 2.0 * ALIKE, False), ('missing_physics', 1.0 - 2.0 * ALIKE, True),
     ('unexplained', -1.0 - 2.0 * ALIKE, True)],
)  # fmt: skip
def test_errors_without_hope_are_not_compared(monkeypatch, verdict, gain, is_compared):
    """Unless the recording is unexplained as it is, for then its laws foresee nothing."""
    compared = []
    found = _found(monkeypatch, lambda *_: compared.append(1) or _of(10.0), ())
    monkeypatch.setattr(connecting, '_gain', lambda *_: gain)
    monkeypatch.setattr(connecting, 'price_of', lambda _: (0.0, 0.0))
    plain = _of(10.0, verdict)
    said = connecting._connected(plain, found, None, in_halves(lambda _: None))
    assert said is plain
    assert bool(compared) is is_compared


@pytest.mark.parametrize(
    ('foresaw', 'is_said'), [(50.0, True), (-1.0, True), (-1.0 - ALIKE, False)]
)
def test_an_error_is_said_that_fits_as_well_with_the_laws_found_without(
    monkeypatch, foresaw, is_said
):
    """The search finds less where it is undone; it is said, and never asserted for that."""
    found = _found(monkeypatch, lambda *_: _of(10.0), ())
    gains = iter([foresaw, -2.0 * ALIKE])
    for name, stub in {
        '_gain': lambda *_: next(gains), 'price_of': lambda _: (10.0, 0.0),
        '_named': lambda _: frozenset(),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    said = connecting._connected(_of(10.0), found, None, in_halves(lambda _: None))
    assert not said.findings
    assert bool(said.equivalents) is is_said
    if is_said:
        assert said.trust == pytest.approx(1.0 / (1.0 + math.exp(TEMPER * min(foresaw, 0.0))))


@pytest.mark.parametrize(
    ('verdict', 'is_enough', 'asserted'),
    [('parameters_only', True, False), ('parameters_only', False, True),
     ('missing_physics', True, True)],
)  # fmt: skip
def test_gains_are_asserted_only_where_bodies_do_not_explain_as_much(
    monkeypatch, verdict, is_enough, asserted
):
    """Heavier bodies behind gains as stated move as lighter ones behind smaller gains do."""
    several = SimpleNamespace(decision=SimpleNamespace(verdict=verdict))
    learned = SimpleNamespace(gains='stated', approach=None)
    plain = Connected(SimpleNamespace(learned=learned, unstated=()), None, several)
    gains = SimpleNamespace(
        hypothesis=SimpleNamespace(joint='knee', effect='gain_scale', is_of_gains=True)
    )
    found = {
        True: SimpleNamespace(errors=(gains,), is_enough=False),
        False: SimpleNamespace(errors=(), is_enough=is_enough),
    }
    for name, stub in {
        'compared': lambda *_: plain, 'choose_bandwidth': lambda *_: None,
        'Probe': lambda *_, knows_bodies=False: knows_bodies, 'search': lambda probe: probe,
        'clear': found.get,
        '_connected': lambda plain, found, *_: replace(plain, findings=found.errors),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    one = connecting.connect(plain.recordings, None, lambda _: None)
    assert bool(one.findings) == asserted
    assert one.trust == (1.0 if asserted else 0.5)
    assert bool(one.equivalents) != asserted


def test_what_known_bodies_leave_possible_is_said_beside_open_ones(monkeypatch):
    """An encoder zero that other bodies explain as well is not forgotten by the next search."""
    several = SimpleNamespace(decision=SimpleNamespace(verdict='missing_physics'))
    learned = SimpleNamespace(gains='stated', approach=None)
    plain = Connected(SimpleNamespace(learned=learned, unstated=()), None, several)
    zero = SimpleNamespace(errors=('zero',), is_enough=False)
    for name, stub in {
        'compared': lambda *_: plain, 'choose_bandwidth': lambda *_: None,
        'Probe': lambda *_, knows_bodies=False: knows_bodies, 'search': lambda probe: probe,
        'clear': {True: zero, False: SimpleNamespace(errors=(), is_enough=False)}.get,
        '_connected': lambda now, found, *_: replace(
            now, equivalents=(*now.equivalents, *found.errors)),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    one = connecting.connect(plain.recordings, None, lambda _: None)
    assert one.equivalents == ('zero',)


@pytest.mark.parametrize(
    ('of_efforts', 'of_motion', 'is_open', 'gain'),
    [
        (60.0, 40.0, False, 30.0), (60.0, -50.0, False, 0.0), (-50.0, 60.0, False, 0.0),
        (12.0, -50.0, False, -60.0), (60.0, 11.0, False, 1.0), (60.0, 11.0, True, 50.0),
        (60.0, 1.0, True, 50.0), (60.0, -1.0, True, 0.0), (15.0, 12.0, True, 2.0),
    ],
)  # fmt: skip
def test_efforts_and_motion_must_both_be_better_explained(of_efforts, of_motion, is_open, gain):
    """Where one clearly is and the other is not, neither side is believed.

    Unless nothing explains the recording as it is, and the other is no worse.
    """

    def side(*worth):
        verdict = 'missing_physics' if any(worth) or not is_open else 'unexplained'
        return SimpleNamespace(
            nominal=np.zeros(1), equations=SimpleNamespace(power=np.ones(1)), verdict=verdict,
            worth=lambda _n, _r, is_of_motion: worth[is_of_motion],
        )  # fmt: skip

    assert connecting._gain(side(0.0, 0.0), side(of_efforts, of_motion), 10.0) == gain


@pytest.mark.parametrize(('certain', 'without', 'kept'),
                         [(0.5, 4.0, ['sign']), (0.5, -4.0, ['sign']), (0.5, -21.0, ['sign']),
                          (0.5, 30.0, ['sign', 'scale']),
                          (0.99, 4.0, ['sign', 'scale'])])  # fmt: skip
def test_an_error_that_is_not_certain_must_be_worth_it_beside_physics(
    monkeypatch, certain, without, kept
):
    """A scale of positions, which a torque constant undoes, explains nothing beside friction.

    Where it explains as much, and is only rarer, it is said beside the others.

    Args:
        monkeypatch: of pytest.
        certain: probability of the scale against other bodies.
        without: by how much both errors explain more than the sign alone [nats].
        kept: errors that are asserted.
    """

    def tried(name, clock):
        hypothesis = SimpleNamespace(
            effect=name,
            joint='all',
            names=(),
            is_of_gains=False,
            applied=lambda c, _: replace(c, clock=1.0),
        )
        none = Correction.none(1)
        return Tried(hypothesis, np.zeros(0), np.zeros(0), replace(none, clock=clock), None)

    def gain(plain, _corrected, _price):
        return 100.0 if plain.correction is None else without

    monkeypatch.setattr(Tried, 'remedy', '')
    monkeypatch.setattr(Correction, 'tree', lambda _self, tree: tree)
    for name, stub in {
        'compared': lambda *_: _of(10.0), '_gain': gain, '_named': lambda _: frozenset(),
        '_promising': lambda _plain, found, _tree: (found, -math.inf),
        'refined': lambda found, *_: (found, False),
        'price_of': lambda found: (10.0, 10.0 * (len(found.errors) - 1)),
        'equal_errors': lambda _: (), '_stands_for_gains': lambda *_: False,
        'error_finding': lambda found, i, _gain: SimpleNamespace(
            effect=found.errors[i].hypothesis.effect, probability=(0.99, certain)[i]),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    found = Connection((tried('sign', 1.0), tried('scale', 2.0)), ((), ()), None, None)
    said = connecting._connected(_of(10.0), found, None, in_halves(lambda _: None))
    assert [f.effect for f in said.findings] == kept
    assert said.correction.clock == len(kept)
    is_said = len(kept) == 1 and without > -ALIKE - 10.0
    assert [e.effects for e in said.equivalents] == [(('all', 'scale'),)] * is_said


@pytest.mark.parametrize(('is_one_law', 'told'), [(True, 170.0), (False, None)])
def test_gains_that_a_torque_constant_imitates_are_as_certain_as_their_search(
    monkeypatch, is_one_law, told
):
    """Under the name of a motor they are there anyway; elsewhere they must be worth more."""
    said = []
    found = _found(monkeypatch, lambda *_: _of(10.0), ())
    start, end = SimpleNamespace(evidence=10.0), SimpleNamespace(evidence=200.0)
    found = replace(found, start=start, end=end)
    for name, stub in {
        '_gain': lambda *_: -1.0, 'price_of': lambda _: (20.0, 0.0),
        '_stands_for_gains': lambda *_: is_one_law, '_named': lambda _: frozenset(),
        '_beside': lambda plain, *_: plain,
        'error_finding': lambda _found, _i, gain: (
            said.append(gain) or SimpleNamespace(probability=0.99)),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    connecting._connected(_of(10.0), found, None, in_halves(lambda _: None))
    assert said == ([told] if is_one_law else [])


@pytest.mark.parametrize(('is_of_gains', 'gain', 'is_asserted'), [
    (True, 5.0, True), (True, -5.0, False), (False, 5.0, False), (False, 15.0, True)])  # fmt: skip
def test_gains_need_not_be_clearly_better_than_physics(
    monkeypatch, is_of_gains, gain, is_asserted
):
    """They are what is stated least surely; the physics in their place is said to be equal."""
    corrected = _of(10.0)
    found = _found(monkeypatch, lambda *_: corrected, ())
    found.errors[0].hypothesis.is_of_gains = is_of_gains
    for name, stub in {
        '_gain': lambda *_: gain, 'price_of': lambda _: (10.0, 0.0),
        '_named': lambda c: frozenset() if c.correction else {('drag', 'knee')},
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    said = connecting._connected(_of(10.0), found, None, in_halves(lambda _: None))
    assert bool(said.findings) is is_asserted
    if is_asserted:
        physics = [(('knee', 'drag'),)] if gain < PER_EFFECT else []
        assert [e.effects for e in said.equivalents] == physics


@pytest.mark.parametrize(
    ('before', 'after', 'gain', 'undone', 'times'),
    [
        (False, False, 5.0, 'found', 1),
        (True, False, 5.0, 'better', 1),
        (False, True, 5.0, 'better', 2),
        (False, True, -5.0, 'found', 2),
    ],
)
def test_better_numbers_are_undone(monkeypatch, before, after, gain, undone, times):
    """Those of the first look before anything is compared, those of the last if worth more."""
    compared = []
    found = _found(monkeypatch, lambda *_: compared.append(1) or _of(10.0), ())
    (error,) = found.errors
    better = SimpleNamespace(**{**vars(error), 'correction': SimpleNamespace(tree=lambda t: t)})
    corrections = {'found': error.correction, 'better': better.correction}
    moves = iter([before, after])

    def refined(now, *_):
        return (replace(now, errors=(better,)), True) if next(moves) else (now, False)

    def worth(_plain, _corrected, price):
        return 100.0 if price else gain

    for name, stub in {
        'refined': refined, '_gain': worth, 'price_of': lambda _: (10.0, 0.0),
    }.items():  # fmt: skip
        monkeypatch.setattr(connecting, name, stub)
    said = connecting._connected(_of(10.0), found, None, in_halves(lambda _: None))
    assert said.correction is corrections[undone]
    assert len(compared) == times


@pytest.mark.parametrize(('joint', 'gain', 'is_undone'), [('elbow', 1.57, True),
                                                        ('elbow', 1.2, False),
                                                        ('shoulder', 1.57, False)])  # fmt: skip
def test_a_scale_that_a_torque_constant_takes_back_is_none(joint, gain, is_undone):
    """Efforts divided by 1.56 and multiplied by 1.57 are as they were recorded."""
    joints = ('shoulder', 'elbow')
    motion = SimpleNamespace(tree=SimpleNamespace(joint_names=joints))
    motor = EffectAt(TORQUE_GAIN, Place(joints.index(joint)), coefficients=np.array([gain - 1.0]))
    corrected = SimpleNamespace(
        equations=SimpleNamespace(motion=motion),
        several=SimpleNamespace(decision=SimpleNamespace(model=SimpleNamespace(effects=(motor,)))),
    )
    scale = SimpleNamespace(
        hypothesis=SimpleNamespace(effect='effort_scale', joint='elbow'),
        numbers=np.array([1.56]), std=np.array([0.1]),
    )  # fmt: skip
    found = SimpleNamespace(errors=(scale,))
    assert connecting._is_taken_back(corrected, found) is is_undone


@pytest.mark.parametrize(
    ('unknown', 'before', 'after', 'noise', 'may_be'),
    [((), 1.0, 0.1, 0.0, False), ((1,), 1.0, 0.1, 0.0, False), ((1,), 1.0, 0.9, 0.0, True),
     ((), 0.03, 0.02, 0.0, True), ((), 0.03, 0.02, 0.019, False), ((), 0.003, 0.002, 0.0, False)],
)  # fmt: skip
def test_numbers_of_an_error_do_not_stand_for_an_unknown_law(
    unknown, before, after, noise, may_be
):
    """A rubber band pulls as a tilted base does, and most of it is left; noise always is."""

    def of(joints, share):
        model = SimpleNamespace(left=np.array([0.0, share]))
        decision = SimpleNamespace(
            verdict='missing_physics', unknown=joints, tentative=None, model=model
        )
        equations = SimpleNamespace(
            model_error=np.array([0.0, 2.0 * noise]), power=np.full(2, 2.0)
        )
        return Connected(None, equations, SimpleNamespace(decision=decision))

    assert connecting._may_be_a_law(of((0, 1), before), of(unknown, after)) is may_be
