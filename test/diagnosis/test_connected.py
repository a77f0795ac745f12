"""Comparisons before an error of the connection is asserted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import connected
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.decide.differences import in_halves
from sgp_ros.diagnosis.result import Finding, Location
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.unknowns import Agreement


def _of(cutoff, verdict='missing_physics'):
    """Return what a comparison up to a cut-off [Hz] returns, as far as it is asked."""
    several = SimpleNamespace(decision=SimpleNamespace(verdict=verdict))
    recordings = SimpleNamespace(
        remarks=(), corrected=lambda _c: None, learned=SimpleNamespace(gains=None)
    )
    return Connected(recordings, SimpleNamespace(filter=SimpleNamespace(cutoff=cutoff)), several)


def _found(monkeypatch, compare, numbers):
    """Return an error of the connection that is worth its price, with what compares recordings."""
    for name, stub in {
        'compared': compare, '_gain': lambda *_: 100.0, 'error_finding': lambda *_: None,
        'equal_errors': lambda _: (), '_stands_for_gains': lambda *_: False,
        'setup_advice': lambda _: 'advice',
    }.items():  # fmt: skip
        monkeypatch.setattr(connected, name, stub)
    hypothesis = SimpleNamespace(names=numbers, is_of_gains=False)
    correction = SimpleNamespace(tree=lambda tree: tree)
    error = SimpleNamespace(
        correction=correction, numbers=numbers, remedy='', hypothesis=hypothesis
    )
    return SimpleNamespace(errors=(error,), delay_std=0.0)


@pytest.mark.parametrize('verdict', ['missing_physics', 'unexplained'])
@pytest.mark.parametrize(('numbers', 'is_asserted'), [((), True), ((0.02,), False)])
def test_something_unknown_beside_it_hides_no_error_without_numbers(
    monkeypatch, verdict, numbers, is_asserted
):
    """A reversed joint imitates no unknown law; an offset may, and is advice beside it."""
    found = _found(monkeypatch, lambda *_: _of(10.0, 'unexplained'), numbers)
    each = in_halves(lambda _: None)
    said = connected._connected(_of(10.0, verdict), found, None, each)
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
    assert connected._connected(_of(plain), found, None, each).correction is correction
    assert len(compared) == times
    assert compared[-1] == corrected


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
        'Probe': lambda *_, knows_bodies=False: knows_bodies, 'search': found.get,
        '_connected': lambda plain, found, *_: replace(plain, findings=found.errors),
    }.items():  # fmt: skip
        monkeypatch.setattr(connected, name, stub)
    one = connected.connect(plain.recordings, None, lambda _: None)
    assert bool(one.findings) == asserted
    assert one.trust == (1.0 if asserted else 0.5)
    assert bool(one.equivalents) != asserted


@dataclass(frozen=True)
class _AsGiven:
    """A scale on which models are worth what they say."""

    nominal: float = 0.0
    power: float = 0.0
    carried: float = 1.0

    def worth(self, model):
        return model.worth


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

    assert connected._gain(side(0.0, 0.0), side(of_efforts, of_motion), 10.0) == gain


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
