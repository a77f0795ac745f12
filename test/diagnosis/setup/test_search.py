"""Errors of how a robot was connected are found, with their numbers, before any physics."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.criteria import DOUBTED
from sgp_ros.diagnosis.result import Finding, Location, Parameter
from sgp_ros.diagnosis.setup import search as searching
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.errors import hypotheses
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.joint import Together, value_of
from sgp_ros.diagnosis.setup.said import doubted_scales
from sgp_ros.diagnosis.setup.search import _gain, _refined, search
from sgp_ros.diagnosis.setup.unknowns import SUDDEN
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.place import Place
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.gains import read_gains
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from test.diagnosis.worlds import recorded
from test.simulation.trees import arm

SHARED = Path(__file__).parents[4] / 'shared'
CASES = SHARED / 'practice2' / 'cases'

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason='shared recordings are elsewhere')


def _raw(case):
    nominal = nominal_model(load_robot(str(case / 'robot.urdf')))
    tree, gains = nominal.tree, None
    if (case / 'gains.yaml').exists():
        gains = read_gains(case / 'gains.yaml', tree.moving_names, tree.moving_names)
    events = open_recording(str(case / 'real.mcap')).events(None, None)
    return collect(events, nominal.robot, nominal.stated, gains=gains), tree


def _found(raw, tree, *, knows_bodies=False):
    probe = Probe(raw, tree, choose_bandwidth(raw, tree), knows_bodies=knows_bodies)
    return search(probe).errors


@pytest.mark.parametrize(
    ('case', 'key', 'numbers'),
    [
        pytest.param('case_02', ('position_scale', 'elbow', ()), [1.06], marks=pytest.mark.long),
        pytest.param('case_03', ('clock_offset', 'all', ()), [0.03], marks=pytest.mark.long),
        pytest.param(
            'case_04', ('base_orientation', 'base', ()), [0.0, np.pi / 2], marks=pytest.mark.long
        ),
        pytest.param(
            'case_08', ('gain_scale', 'shoulder', ()), [0.8, 1.0], marks=pytest.mark.long
        ),
    ],
)
def test_an_error_of_the_connection_is_found_with_its_numbers(case, key, numbers):
    (error,) = _found(*_raw(CASES / case))
    assert error.hypothesis.key == key
    assert error.numbers == pytest.approx(numbers, abs=0.02)
    assert error.remedy


@pytest.mark.parametrize(
    'folder',
    ['practice/cases/case_05', pytest.param('practice2/cases/case_05', marks=pytest.mark.long)],
)
def test_friction_is_no_error_of_the_connection(folder):
    assert not _found(*_raw(SHARED / folder))


@pytest.mark.long
@pytest.mark.parametrize('presliding', [0.005, 0.02])
def test_friction_that_builds_up_is_no_late_clock(tmp_path, presliding):
    """After each reversal it lags as late efforts would."""
    effects = [f'hysteresis:joint={joint},level={level},presliding={presliding}'
               for joint, level in (('shoulder', 5.0), ('elbow', 2.0))]  # fmt: skip
    assert not _found(*recorded(tmp_path, arm(), effects))


@pytest.mark.parametrize(('clock', 'gain'), [(0.0, 40.0), (0.02, 5.0)])
def test_another_clock_is_worth_it_beside_either_kind_of_friction(clock, gain):
    """Likely only beside friction that builds up, it may be play, or a spring."""
    none = Correction.none(1)
    late = replace(none, clock=clock, scale=np.array([2.0]))
    evidence = {(): 50.0, (SUDDEN,): 15.0}
    probe = SimpleNamespace(agreement=lambda c, *unknowns, nominal: SimpleNamespace(
        evidence=evidence[unknowns] * (c is late)))  # fmt: skip
    now = SimpleNamespace(nominal=np.ones(1))
    tried = SimpleNamespace(agreement=now, correction=late, hypothesis=SimpleNamespace(names=()))
    assert _gain(probe, tried, none, now) == pytest.approx(gain)


@pytest.mark.long
def test_a_delay_of_targets_is_physics_and_not_a_clock():
    assert not _found(*_raw(CASES / 'case_09'))


@pytest.mark.long
def test_gains_are_found_beside_a_delay_of_the_targets():
    """The delay stays: it is physics, but every gain looks wrong as long as it is there."""
    raw, tree = _raw(CASES / 'case_08')
    late = replace(raw, drive=raw.drive.changed(lambda targets: targets, -0.02))
    (error,) = _found(late, tree, knows_bodies=True)
    assert error.hypothesis.key == ('gain_scale', 'shoulder', ())
    assert error.numbers == pytest.approx([0.8, 1.0], abs=0.02)
    assert error.correction.clock == 0.0


def test_a_delay_that_gains_hide_is_found_beside_them():
    """Alone neither explains the motion."""
    raw, tree = _raw(CASES / 'case_08')
    late = replace(raw, drive=raw.drive.changed(lambda targets: targets, -0.02))
    probe = Probe(late, tree, choose_bandwidth(late, tree), knows_bodies=True)
    (gains,) = (h for h in hypotheses(probe.full) if h.key[:2] == ('gain_scale', 'shoulder'))
    alone = searching._refined(probe, Correction.none(tree.size), gains, np.array([1.0, 1.0]))
    ((delay, beside),) = searching._delayed(probe, [alone])
    assert delay.numbers == pytest.approx([0.02], abs=0.001)
    assert beside.numbers == pytest.approx([0.8, 1.0], abs=0.02)
    assert searching._delayed(probe, []) == []


def test_a_delay_and_gains_are_searched_together():
    """From numbers that are wrong in both."""
    raw, tree = _raw(CASES / 'case_08')
    late = replace(raw, drive=raw.drive.changed(lambda targets: targets, -0.02))
    probe = Probe(late, tree, choose_bandwidth(late, tree), knows_bodies=True)
    known = {h.key[:2]: h for h in hypotheses(probe.full)}
    gains = known['gain_scale', 'shoulder']
    (delay,) = (h for h in known.values() if h.is_physics)
    start = np.array([0.005]), np.array([1.1, 0.8])
    both = Together(probe, (delay, gains), start).best()
    assert both.numbers[0] == pytest.approx([0.02], abs=0.001)
    assert both.numbers[1] == pytest.approx([0.8, 1.0], abs=0.02)
    assert all((std > 0.0).all() and (std < 0.02).all() for std in both.std())


@pytest.mark.parametrize(('more', 'chosen'), [(5.0, 'one'), (7.0, 'three')])
def test_of_errors_that_explain_nearly_the_same_the_one_with_fewer_numbers_is_chosen(
    monkeypatch, more, chosen
):
    """Three numbers move an origin as a wrong zero of the joint before it would, and more."""
    one, three = (
        SimpleNamespace(
            numbers=np.zeros(m), correction=None, agreement=SimpleNamespace(evidence=evidence),
            hypothesis=SimpleNamespace(key=name, is_physics=False, names=('x',) * m),
        )
        for name, m, evidence in (('one', 1, 20.0), ('three', 3, 26.0 + more))
    )  # fmt: skip
    found = [[three, one], []]
    monkeypatch.setattr(searching, '_ranked', lambda *_, **__: found.pop(0))
    monkeypatch.setattr(searching, '_gain', lambda *_: 1.0)
    tree = SimpleNamespace(motion=SimpleNamespace(tree=SimpleNamespace(size=1)))
    errors, rivals = searching._grown(tree, [], None)
    assert [e.hypothesis.key for e in errors] == [chosen]
    assert [[r.hypothesis.key for r in x] for x in rivals.values()] == [
        [{'one': 'three', 'three': 'one'}[chosen]]
    ]


def test_what_corrects_an_error_makes_the_recording_agree():
    raw, tree = _raw(CASES / 'case_06')
    wrong = Correction.none(tree.size)
    wrong.offset[1], wrong.effort_scale[2] = 0.1, -1.0
    shown = wrong.recording(raw)
    undone = wrong.recording(shown)
    assert undone.position[:, 0] == pytest.approx(raw.position[:, 0])
    assert shown.position[:, 1] == pytest.approx(raw.position[:, 1] - 0.1)
    assert undone.drive.values == pytest.approx(raw.drive.values)


def test_every_hypothesis_proposes_a_change_that_its_neutral_numbers_do_not_make():
    raw, tree = _raw(CASES / 'case_02')
    probe = Probe(raw, tree, choose_bandwidth(raw, tree))
    none = Correction.none(tree.size)
    plain = probe.agreement(none)
    for h in hypotheses(probe.full):
        neutral = probe.agreement(h.applied(none, h.neutral))
        changed = probe.agreement(h.applied(none, h.starts[0] if len(h.names) else h.neutral))
        if h.names:
            assert neutral.distance(plain) == pytest.approx(0.0, abs=1e-12), h.key
        elif h.key[:2] != ('joint_sign', 'waist'):  # about gravity, a turn is as good as another
            assert changed.distance(plain) > 0.0, h.key


def test_a_correction_agrees_the_same_whatever_was_looked_at_before():
    """Columns of a motion are remembered: a correction of efforts alone takes them as they are."""
    raw, tree = _raw(CASES / 'case_02')
    used = Probe(raw, tree, choose_bandwidth(raw, tree))
    moved, driven = Correction.none(tree.size), Correction.none(tree.size)
    moved.offset[1], driven.effort_scale[2] = 0.1, 0.7
    for correction in (Correction.none(tree.size), moved, driven, moved):
        fresh = Probe(raw, tree, choose_bandwidth(raw, tree)).agreement(correction)
        again = used.agreement(correction)
        assert again.evidence == fresh.evidence
        assert (again.discrepancy == fresh.discrepancy).all()
    assert used.agreement(moved).evidence != used.agreement(driven).evidence


@pytest.mark.parametrize(
    ('low', 'high', 'scale', 'offset', 'is_kept'),
    [(-1.0, 1.0, 1.1, 0.0, True), (-1.0, 1.0, 0.1, 0.0, False), (-1.0, 1.0, 1.0, 3.0, False),
     (-1.0, 1.0, -1.0, 0.0, True), (-0.2, 9.0, -1.0, 0.0, True), (0.0, 0.0, 0.01, 0.0, True),
     (-np.inf, np.inf, 0.01, 0.0, True)],
)  # fmt: skip
def test_no_correction_leads_a_joint_far_beyond_limits_that_it_was_seen_to_keep(
    low, high, scale, offset, is_kept
):
    """It has not been there; a recording beyond them says that they, or its unit, are others."""
    seen = np.linspace(-0.8, 0.8, 50)[:, None]
    tree = SimpleNamespace(lower=np.array([low, 0.0]), upper=np.array([high, 0.0]))
    wrong = Correction.none(1)
    wrong.scale[0], wrong.offset[0] = scale, offset
    motion = SimpleNamespace(tree=tree, position=seen)
    assert wrong.keeps_limits(motion) is is_kept
    hypothesis = SimpleNamespace(applied=lambda *_: wrong, is_possible=lambda _: True,
                                 is_of_gains=False)  # fmt: skip
    motion.tree.size = 1
    probe = SimpleNamespace(motion=motion,
                            agreement=lambda *_: SimpleNamespace(evidence=5.0))  # fmt: skip
    expected = 5.0 if is_kept else -np.inf
    assert value_of(probe, wrong, hypothesis, np.ones(1)) == expected
    assert Together(probe, (hypothesis,), (np.ones(1),)).evidence == expected


def test_what_cannot_be_is_not_searched(monkeypatch):
    """A hypothesis all starts of which are impossible would be refined from one of them."""
    impossible = SimpleNamespace(key=(), starts=np.array([[0.1], [10.0]]))
    monkeypatch.setattr(searching, 'hypotheses', lambda _motion: [impossible])
    monkeypatch.setattr(searching, 'value_of', lambda *_: -np.inf)
    now = SimpleNamespace(evidence=0.0, unknowns=0)
    probe = SimpleNamespace(full=None, most_usual=0)
    assert searching._ranked(probe, None, now, [], is_beside_delay=False) == []


def test_a_corrected_motion_is_scaled_with_its_derivatives():
    raw, tree = _raw(CASES / 'case_02')
    probe = Probe(raw, tree, choose_bandwidth(raw, tree))
    wrong = Correction.none(tree.size)
    wrong.scale[2], wrong.offset[2], wrong.effort_scale[1] = 2.0, 0.1, 4.0
    seen = probe.motion
    right = wrong.motion(seen, probe.acting(0.0))
    assert right.position[:, 2] == pytest.approx((seen.position[:, 2] - 0.1) / 2.0)
    assert right.velocity[:, 2] == pytest.approx(seen.velocity[:, 2] / 2.0)
    assert right.acceleration[:, 2] == pytest.approx(seen.acceleration[:, 2] / 2.0)
    assert right.effort[:, 1] == pytest.approx(seen.effort[:, 1] / 4.0)
    assert right.effort[:, 0] == pytest.approx(seen.effort[:, 0])


@pytest.mark.parametrize(
    ('evidence', 'number', 'is_known'),
    [
        (
            lambda x: 900.0 - np.log(x / 900.0) ** 2,
            1000.0,
            True,
        ),  # bodies make up for it
        (lambda x: -((x - 1030.0) ** 2), 1030.0, True),  # measured, and of no unit
        (lambda _: 900.0, 1.0, False),
    ],
)
def test_a_number_of_which_bodies_make_up_is_that_of_a_unit(evidence, number, is_known):
    """A torque in mN m: the evidence hardly falls over half a decade, and no number is better."""
    probe = SimpleNamespace(
        agreement=lambda c: SimpleNamespace(evidence=float(evidence(c.x)), left=np.zeros(1)),
        motion=None,
    )
    scale = SimpleNamespace(
        steps_at=lambda x: 0.02 * np.abs(x), is_possible=lambda x: x[0] > 0.0, exact=(1e-3, 1e3),
        applied=lambda _base, x: SimpleNamespace(x=x[0], keeps_limits=lambda _motion: True),
        canonical=lambda x: x, neutral=np.ones(1),
    )  # fmt: skip
    start = np.array([1000.0])
    found = _refined(probe, None, scale, start)
    assert np.isfinite(found.std[0]) == is_known
    assert found.numbers[0] == pytest.approx(number, rel=1e-4)


def _shares(left, nominal=1.0):
    return np.array([1.0, nominal]), np.array([0.0, left])


@pytest.mark.parametrize(
    ('effect', 'joint', 'law', 'is_doubted'),
    [
        ('effort_scale', 'elbow', 'torque_gain', True),
        ('effort_scale', 'elbow', 'coulomb_friction', False),
        ('effort_scale', 'shoulder', 'torque_gain', False),
        ('joint_sign', 'elbow', 'torque_gain', False),
    ],
)
def test_a_scale_of_an_effort_is_doubted_beside_a_gain_of_it(effect, joint, law, is_doubted):
    """Together they may be right, neither alone need be."""
    tree = SimpleNamespace(moving_names=('shoulder', 'elbow'))
    found = Finding(joint, effect, {'scale': Parameter(0.9)}, Location(), 50.0, 0.98, 1.0)
    (said,) = doubted_scales((found,), [EffectAt(EFFECTS[law], Place(1))], _shares(0.0), tree)
    assert said.probability == (DOUBTED if is_doubted else 0.98)
    assert bool(said.why) is is_doubted


@pytest.mark.parametrize(
    ('left', 'nominal', 'is_doubted'),
    [(0.003, 1.0, False), (0.004, 1.0, True), (0.003, 0.008, True), (0.002, 0.008, False)],
)
def test_a_scale_of_an_effort_is_doubted_that_leaves_much_of_what_it_explains(
    left, nominal, is_doubted
):
    """Of the hundredth of the mean square that a scale of 0.9 explains, or of all there is."""
    tree = SimpleNamespace(moving_names=('shoulder', 'elbow'))
    found = Finding(
        'elbow', 'effort_scale', {'scale': Parameter(0.9)}, Location(), 50.0, 0.98, 1.0
    )
    (said,) = doubted_scales((found,), [], _shares(left, nominal), tree)
    assert said.probability == (DOUBTED if is_doubted else 0.98)


@pytest.mark.parametrize('is_open', [True, False])
def test_a_scale_of_an_effort_is_doubted_beside_a_formula_that_was_found(is_open):
    """A law of the position fills what a wrong scale opens; one that is stated is known."""
    tree = SimpleNamespace(moving_names=('shoulder', 'elbow'))
    found = Finding(
        'elbow', 'effort_scale', {'scale': Parameter(0.9)}, Location(), 50.0, 0.98, 1.0
    )
    law = FormulaLaw(read_formula('q[elbow]**2', is_law=True), 'elbow', (), is_open=is_open)
    (said,) = doubted_scales((found,), [EffectAt(law, Place(1))], _shares(0.0), tree)
    assert said.probability == (DOUBTED if is_open else 0.98)
