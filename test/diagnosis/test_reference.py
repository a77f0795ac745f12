"""With a simulation as the reference, what differs from it is found, in either direction."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.diagnosis import pipeline, reference
from sgp_ros.diagnosis.decide.certainty import settled_of
from sgp_ros.diagnosis.decide.differences import decide_several
from sgp_ros.diagnosis.reference import (
    _compared,
    _counts,
    _judged,
    _sized,
    against_model,
    against_simulation,
)
from sgp_ros.diagnosis.result import Finding, Location, Parameter
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.worlds import events_of

CASES = Path(__file__).parents[3] / 'shared' / 'practice2' / 'cases'
ANSWERS = CASES.parent / 'answers'


def test_a_law_of_the_simulation_that_bodies_may_be_is_not_said_to_be_absent(equations_for, heavy):
    """A rotor of one joint and a link with more inertia are one, unlike friction."""
    _, equations = equations_for(heavy[1])
    several = decide_several(equations, 1, lambda _share: None, lambda _: equations)
    assert several.decision.model.is_free
    rotor = EffectAt(EFFECTS['armature'], Place(0), coefficients=np.array([0.03]))
    rub = EffectAt(EFFECTS['viscous_friction'], Place(0), coefficients=np.array([0.5]))
    found = against_model(equations, several, [rotor, rub])
    assert [f.effect for f in found.findings] == ['viscous_friction']
    assert [f.effect for f in found.shared] == ['armature']
    assert found.shared[0].probability > 0.5


@pytest.mark.parametrize('is_same', [True, False])
def test_bodies_are_compared_with_those_of_the_simulation(equations_for, heavy, perfect, is_same):
    """A link that only the file has wrong is no difference."""
    (_, real), (_, sim) = (
        equations_for(heavy[1]),
        equations_for((heavy if is_same else perfect)[1]),
    )
    ours, theirs = (decide_several(x, 1, lambda _share: None, lambda _: real) for x in (real, sim))
    found = against_simulation(real, ours, sim, theirs)
    assert found.verdict == ('no_mismatch' if is_same else 'parameters_only')
    assert bool(found.bodies) is not is_same
    assert found.findings == ()


@pytest.mark.parametrize('is_same', [True, False])
def test_bodies_that_no_number_places_are_told_in_words(
    equations_for, heavy, perfect, monkeypatch, is_same
):
    """Where bodies differ from those of the simulation, and there alone."""
    (_, real), (_, sim) = (equations_for(x[1]) for x in (heavy, heavy if is_same else perfect))
    monkeypatch.setattr(reference, 'traded_remarks', lambda *_: iter(['told']))
    ours, theirs = (decide_several(x, 1, lambda _share: None, lambda _: real) for x in (real, sim))
    assert against_simulation(real, ours, sim, theirs).remarks == (() if is_same else ('told',))


def test_remarks_of_the_comparison_are_those_of_the_diagnosis(robots, dry, viscous, monkeypatch):
    robot, tree = robots[1]
    compared = pipeline.against_simulation

    def remarked(*given):
        return replace(compared(*given), remarks=('told',))

    monkeypatch.setattr(pipeline, 'against_simulation', remarked)
    found = pipeline.diagnose(events_of(dry), robot, tree, {}, simulation=events_of(viscous))
    assert 'told' in found.remarks


@pytest.mark.parametrize('refuses', [False, True])
def test_laws_that_are_refused_do_not_differ_from_a_simulation(
    robots, dry, viscous, monkeypatch, refuses
):
    """Of what was found first, only what is asserted in the end is compared."""

    def refused(several):
        several, *rest = settled_of(several)
        plain = several.comparison.base
        decision = replace(several.decision, model=plain, verdict='parameters_only')
        return replace(several, decision=decision, model=plain), *rest

    if refuses:
        monkeypatch.setattr(pipeline, 'settled_of', refused)
    robot, tree = robots[1]
    found = pipeline.diagnose(events_of(dry), robot, tree, {}, simulation=events_of(viscous))
    assert found.reference == 'simulation'
    names = {f.effect for f in (*found.findings, *found.shared)}
    assert names == (set() if refuses else {'coulomb_friction', 'viscous_friction'})


@pytest.mark.parametrize(
    ('apart', 'share', 'theirs', 'probability', 'why'),
    [(0.9, 1.0, 0.6, 0.9, None), (0.9, 1e-3, 0.6, 0.9, 'too little'),
     (0.9, 1.0, 0.9, 0.9, 'warmth'), (0.9, 1.0, 1.1, 0.9, 'warmth'), (0.9, 1.0, 1.2, 0.9, None),
     (0.9, 1.0, -1.0, 0.9, None), (0.05, 1.0, 0.6, 0.95, None), (0.0, 1.0, 0.6, 0.99, None)],
)  # fmt: skip
def test_what_both_have_is_as_probable_as_it_is_alike(apart, share, theirs, probability, why):
    """A difference that is seen, but counts too little, is said with its reason."""
    ours = {'level': Parameter(1.0, 0.01, 'N m')}
    found = Finding('knee', 'coulomb_friction', ours, Location(), 1.0, apart, share,
                    difference={'level': Parameter(1.0 - theirs, 0.01, 'N m')})  # fmt: skip
    law = EffectAt(EFFECTS['coulomb_friction'], Place(0))
    judged = _judged(found, law)
    assert judged.probability == pytest.approx(probability)
    assert (why or '') in (judged.why or '')
    assert bool(judged.why) is bool(why)
    assert _counts(found, law) is (why is None and apart > 0.5)


@pytest.mark.parametrize('stiffness', [0.01, 0.6])
def test_a_law_that_the_machine_has_none_of_has_no_place_there(equations_for, heavy, stiffness):
    """A spring of no stiffness rests nowhere; that of the simulation does."""
    _, real = equations_for(heavy[1])
    laws = [EffectAt(EFFECTS['spring'], Place(0), coefficients=np.array([k, k * rest]))
            for k, rest in ((stiffness, -5.0), (0.9, 0.4))]  # fmt: skip
    spread = {'stiffness': 0.05, 'rest': 3.0}
    found = _sized(_compared(*laws, (spread, {}), real), laws[0], is_in_simulation=True)
    has_place = stiffness > 0.1
    assert ('rest' in found.parameters) is ('rest' in found.difference) is has_place
    assert set(found.in_simulation) == {'stiffness', 'rest'}
    assert {'stiffness'} <= set(found.parameters) & set(found.difference)


def test_only_what_nearly_every_joint_has_may_differ_by_a_tenth():
    """A spring that is a little stiffer in the machine is another one."""
    numbers = {'stiffness': Parameter(1.0, 0.01, 'N m/rad')}
    apart = {'stiffness': Parameter(0.1, 0.01, 'N m/rad')}
    found = Finding('knee', 'spring', numbers, Location(), 1.0, 0.9, 1.0, difference=apart)
    assert _counts(found, EffectAt(EFFECTS['spring'], Place(0)))


def test_a_law_that_the_simulation_is_not_known_to_have_has_no_place_there():
    """Its size is asked for where the machine has it."""
    numbers = {
        'position': Parameter(0.3, 0.1, 'rad'),
        'stiffness': Parameter(0.0, None, 'N m/rad'),
    }
    stop = Finding('knee', 'end_stop', numbers, Location(), 1.0, 0.9, 1.0,
                   in_simulation=numbers, difference=numbers)  # fmt: skip
    sized = _sized(stop, EffectAt(EFFECTS['end_stop'], Place(0)), is_in_simulation=False)
    assert set(sized.in_simulation) == set(sized.difference) == {'stiffness'}
    assert set(sized.parameters) == {'position', 'stiffness'}


@pytest.mark.parametrize(
    ('level', 'is_in_simulation', 'differs'),
    [(0.02, False, True), (0.02, True, False), (0.5, False, False)],
)
def test_what_a_simulation_is_not_known_to_have_is_no_likelier_there_than_nothing(
    equations_for, perfect, level, is_in_simulation, differs
):
    """It is known too inaccurately to be different; nothing fits it as well as its own size."""
    _, equations = equations_for(perfect[1])
    here, there = (
        EffectAt(EFFECTS['coulomb_friction'], Place(0), coefficients=np.array([x]))
        for x in (0.9, level)
    )
    std = {'level': 0.13}, {'level': 0.24}
    found = _compared(here, there, std, equations, is_in_simulation=is_in_simulation)
    assert (found.probability > 0.5) is differs


@pytest.mark.skipif(not CASES.is_dir(), reason='shared recordings are elsewhere')
@pytest.mark.long
@pytest.mark.parametrize('case', ['case_05', 'case_06', 'case_07'])
def test_the_machine_is_compared_with_its_simulation(case, tmp_path, capsys):
    folder = CASES / case
    words = ['diagnose', str(folder / 'real.mcap'), '--sim', str(folder / 'sim.mcap'), '--robot',
             str(folder / 'robot.urdf'), '--test', str(folder / 'real_test.mcap'),
             '--out', str(tmp_path)]  # fmt: skip
    assert main(words) == 0
    found = json.loads((tmp_path / 'diagnosis.json').read_text())
    answer = json.loads((ANSWERS / f'{case}.json').read_text())
    assert found['reference'] == 'simulation'
    assert found['verdict'] == answer['verdict']
    printed = capsys.readouterr().out
    assert len(found['findings']) == len(answer['findings'])
    for right, said in zip(answer['findings'], found['findings'], strict=True):
        assert (said['joint'], said['effect']) == (right['joint'], right['effect'])
        for side in ('parameters', 'in_simulation', 'difference'):
            for name, true in right[side].items():
                number = said[side][name]
                assert abs(number['value'] - true) < 3.0 * number['std'] + 0.002
        assert 'in the simulation level' in printed
    if not answer['findings']:
        shared = {(f['joint'], f['effect']) for f in found['shared']}
        assert {(j, 'coulomb_friction') for j in ('waist', 'shoulder', 'elbow')} <= shared
        assert 'No mismatch' in printed


@pytest.mark.parametrize('joint', [None, 1])
def test_what_friction_takes_at_rest_is_no_difference(joint):
    """There it is what drives the joint, whatever a law of Stribeck says of no speed."""
    rests = np.zeros((10, 2), dtype=bool)
    rests[4:, 1] = True
    force = np.zeros((10, 2))
    force[:, 1] = 3.0
    equations, power = SimpleNamespace(rests=rests), np.array([1.0, 9.0])
    found = reference._share(force if joint is None else force[:, 1], equations, power, joint or 0)
    assert found == pytest.approx(0.4)
