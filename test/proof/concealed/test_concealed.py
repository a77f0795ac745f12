"""Laws of the worlds with concealed physics."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_proof.concealed import draw, paper, robots, run, scoring, sizes
from sgp_proof.concealed.concealed_effect import OUTSIDE, Concealed
from sgp_proof.concealed.oracle import Oracle, Unlisted, candidates, error, nominal_error, share
from sgp_proof.concealed.unknown import UNKNOWN
from sgp_proof.paper.figure_eight import ARM
from sgp_proof.result_files import RESULTS
from sgp_ros.physics.catalogue import EFFECTS, VISCOUS_FRICTION
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.effects import Moment
from sgp_ros.simulation.registry import LAWS
from sgp_ros.simulation.tree_text import read_tree

KEYS = {
    'case', 'key', 'tier', 'robot', 'joints', 'verdict', 'effects', 'accepted', 'location',
    'parameter_errors', 'joint_range', 'sensor', 'rate_hz', 'durations', 'effect_share_of_torque',
    'nmse', 'fit_scored',
}  # fmt: skip


def test_plan_has_every_effect():
    """Those of the catalogue, in turn."""
    assert set(LAWS) <= set(draw.PLAN)
    assert set(EFFECTS) == set(LAWS)


def test_a_concealed_effect_has_the_parameters_of_its_size():
    """It is an effect as any other at each size; what no list has stays outside the simulation."""
    concealed = Concealed.of(VISCOUS_FRICTION, 'elbow', 1, lambda size: {'b': size}, 0.5)
    concealed.size *= 4.0
    found = concealed.chosen()
    assert (found.effect, found.joint, found.parameters) == (VISCOUS_FRICTION, 'elbow', {'b': 2.0})
    assert concealed.unlisted(()) == ()
    assert Concealed.of(OUTSIDE, 'elbow', 1, dict, 1.0).chosen() is None


@pytest.mark.parametrize('tier', ['a', 'b'])
def test_a_seed_conceals_what_it_concealed_in_the_committed_results(tier):
    """The order of the plan is part of every seed: a new effect goes to its end."""
    found = json.loads((RESULTS / f'concealed_{tier}.json').read_text(encoding='utf-8'))
    for case in found['cases']:
        wanted = draw.planned(int(case['case'].removeprefix('case_')))
        assert case['key'].startswith(f'{tier.upper()}_{wanted}_'), case['case']


@pytest.mark.parametrize('family', robots.FAMILIES)
def test_drawn_robots_are_trees_with_bodies_that_can_exist(family):
    """The principal moments of each body obey the triangle inequality."""
    for seed in range(5):
        bodies = robots.FAMILIES[family][0](np.random.default_rng(seed))
        for body in bodies:
            moments = np.linalg.eigvalsh(body.inertia)
            assert moments[0] > 0.0
            assert moments[0] + moments[1] >= moments[2]


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """From what is concealed to the folder of a world with short recordings."""
    worlds = {}

    def draw_once(only):
        if only not in worlds:
            worlds[only] = tmp_path_factory.mktemp(only)
            for folder in ('cases', 'answers'):
                (worlds[only] / folder).mkdir()
            with pytest.MonkeyPatch.context() as patch:
                short = dict.fromkeys(('real', 'real_test', 'real_far'), 4.0)
                patch.setattr(draw, '_SECONDS', short)
                patch.setattr(sizes, '_PILOT_S', 4.0)
                draw.draw_case(0, 'A', only, worlds[only])
        return worlds[only]

    return draw_once


@pytest.mark.long
def test_drawn_case_has_the_layout_and_the_size_that_was_promised(drawn):
    """Recordings, URDF, answers and true accelerations of one world."""
    tmp_path = drawn('viscous_friction')
    answer = json.loads((tmp_path / 'answers' / 'case_000.json').read_text(encoding='utf-8'))
    assert set(answer) >= KEYS
    found = {path.name for path in (tmp_path / 'cases' / 'case_000').iterdir()}
    assert found == {'robot.urdf', 'sim.mcap', 'real.mcap', 'real_test.mcap', 'real_far.mcap'}
    joint = answer['effects'][0]['joint']
    assert answer['effect_share_of_torque'][joint] > sizes.SMALLEST_SHARE
    assert answer['verdict'] == 'missing_physics'
    urdf = (tmp_path / 'cases' / 'case_000' / 'robot.urdf').read_text(encoding='utf-8')
    assert [j.name for j in read_tree(urdf).joints] == answer['joints']
    truth = np.load(tmp_path / 'answers' / 'case_000_truth.npz', allow_pickle=False)
    assert truth['real_far_a'].shape == (len(truth['real_far_t']), len(answer['joints']))


@pytest.mark.parametrize(
    ('name', 'built_in'), [('pendulum', 'toy_pendulum'), ('wheel', 'reaction_wheel_6')]
)
def test_the_papers_robots_are_those_of_the_package_without_friction(tmp_path, name, built_in):
    """The mass matrix at rest, hanging or upright, is that of the built-in robot."""
    family, bodies, _ = paper.CONCEALMENTS[name](1.0)
    path = tmp_path / 'robot.urdf'
    path.write_text(robots.urdf(family, bodies), encoding='utf-8')
    drawn = nominal_model(load_robot(str(path))).tree
    stated = nominal_model(load_robot(built_in)).tree
    q = np.zeros((1, drawn.size))
    M, known = (mass_matrix(tree, tree.parameters, q)[0] for tree in (drawn, stated))
    ball = paper.BALL if name == 'pendulum' else 0.0
    np.testing.assert_allclose(M, known + ball, rtol=1e-9)
    assert not drawn.damping.any()


def test_the_papers_arm_has_its_friction_towards_both_limits():
    """As the arm of the reproduction has it, counted from the middle of the range."""
    _, bodies, effects = paper.arm(1.0)
    friction, body = ARM.frictions[2], bodies[2]
    middle = 0.5 * (friction.lower + friction.upper)
    for q in np.linspace(-body.limit, body.limit, 9):
        added = sum(
            e.at.parameters['amplitude']
            * max(0.0, (q - (x := e.at.parameters['onset'])) / (np.sign(x) * body.limit - x))
            for e in effects
        )
        assert added == pytest.approx(float(friction.near_limits(np.array(middle + q))))


def test_what_is_too_small_to_count_is_not_asked_for():
    """A row tells which of the concealed effects count, and what was named beside them."""
    row = {
        'truth': [['viscous_friction', 'pole'], ['viscous_friction', 'wheel']],
        'found': [['viscous_friction', 'wheel', 0.9], ['hysteresis', 'pole', 0.8]],
    }
    found = paper.with_shares(row, 1.0, [0.001, 0.07])
    assert (found['counting'], found['counting_found'], found['spurious']) == (1, 1, 1)


def test_two_effects_of_one_name_on_one_joint_are_each_compared_with_their_own():
    """In whatever order they are found; one finding does not stand for both."""

    def entry(onset):
        return {'effect': 'limit_friction', 'joint': 'j', 'scored': ['onset'],
                'parameters': {'onset': onset}}  # fmt: skip

    def finding(onset):
        return {'effect': 'limit_friction', 'joint': 'j',
                'parameters': {'onset': {'value': onset, 'std': 0.02}}}  # fmt: skip

    answer = {'effects': [entry(0.3), entry(-0.3)], 'joint_range': {'j': [-1.0, 1.0]}}
    both = {'findings': [finding(-0.31), finding(0.31)]}
    assert scoring.components(answer, both) == 2
    scores = scoring.parameter_scores(answer, both)
    assert [s['error'] for s in scores] == pytest.approx([0.005, 0.005])
    assert all(s['covered'] for s in scores)
    assert scoring.components(answer, {'findings': [finding(0.3)]}) == 1
    assert len(scoring.parameter_scores(answer, {'findings': [finding(0.3)]})) == 1


def test_a_diagnosis_that_was_kept_is_scored_and_not_made_again(tmp_path):
    """The recordings are not there any more; what the command said then counts."""
    answers, out = tmp_path / 'answers', tmp_path / 'out'
    for folder in (answers, out):
        folder.mkdir()
    answer = {'key': 'A_none_pendulum', 'verdict': 'no_mismatch', 'effects': []}
    (answers / 'case_001.json').write_text(json.dumps(answer), encoding='utf-8')
    np.savez(answers / 'case_001_truth.npz', real_test_t=np.zeros(1))
    outcome = {'status': 2, 'why': 'nothing moves', 'seconds': 0.5}
    (out / run.OUTCOME).write_text(json.dumps(outcome), encoding='utf-8')
    row = run.scored_case(tmp_path, 'case_001', out)
    assert (row['said'], row['why'], row['seconds']) == ('failed', 'nothing moves', 0.5)


def _answer(folder):
    return json.loads((folder / 'answers' / 'case_000.json').read_text(encoding='utf-8'))


@pytest.mark.long
@pytest.mark.parametrize('only', ['viscous_friction', 'hysteresis', draw.PARAMETERS])
def test_the_true_structure_finds_the_true_numbers_and_predicts_what_was_held_out(drawn, only):
    """The simulation shares no code with it. Filters leave up to a thousandth of any robot."""
    folder = drawn(only)
    answer, case = _answer(folder), folder / 'cases' / 'case_000'
    truth = np.load(folder / 'answers' / 'case_000_truth.npz', allow_pickle=False)
    oracle = Oracle.fitted(case, answer)
    scores = scoring.parameter_scores(answer, {'findings': oracle.findings()})
    assert len(scores) == sum(len(effect['scored']) for effect in answer['effects'])
    assert all(score['error'] < 0.01 for score in scores)
    for stem in scoring.HELD_OUT:
        found = oracle.predict(case / f'{stem}.mcap')
        left = error(truth, stem, found.time, found.acceleration)
        assert left < 0.02 * nominal_error(answer, stem) + 1e-3


@pytest.mark.long
def test_where_the_fit_of_the_true_structure_starts_does_not_show(drawn):
    """It is a fit: started from half the true way before a bristle slides, it finds the same."""
    folder = drawn('hysteresis')
    answer, case = _answer(folder), folder / 'cases' / 'case_000'
    other_start = _answer(folder)
    other_start['effects'][0]['parameters']['presliding'] *= 0.5
    (one,), (other,) = (Oracle.fitted(case, a).findings() for a in (answer, other_start))
    for name, entry in one['parameters'].items():
        assert other['parameters'][name]['value'] == pytest.approx(entry['value'], rel=1e-3)


def test_the_true_shape_lies_within_the_bounds_of_its_fit(tmp_path):
    """Also a cable with a ratio that the diagnosis sees from its other end."""
    family, bodies, _ = paper.CONCEALMENTS['wheel'](1.0)
    path = tmp_path / 'robot.urdf'
    path.write_text(robots.urdf(family, bodies), encoding='utf-8')
    tree, rng = nominal_model(load_robot(str(path))).tree, np.random.default_rng(0)
    motion = ObservedMotion(tree, np.arange(7.0), 1.0, *rng.normal(size=(4, 7, 2)), drive=None)
    numbers = {'kind': 'spring', 'source_joint': 'wheel', 'stiffness': 1.0}
    for ratio in (14.0, -7.0, 1.5):
        cable = {'effect': 'joint_coupling', 'joint': 'pole',
                 'parameters': numbers | {'ratio': ratio}}  # fmt: skip
        (candidate,) = candidates({'effects': [cable]}, motion)
        low, high = candidate.effect.bounds(motion, candidate.place)
        assert low[0] < ratio < high[0]


@pytest.mark.parametrize('kind', UNKNOWN)
def test_of_an_unlisted_effect_the_size_alone_is_open(kind):
    """Its column times the size is what the simulation adds to the motor's force."""
    names, n = ('a', 'b'), 7
    rng = np.random.default_rng(0)
    motion = ObservedMotion(
        None, np.linspace(0.0, 6.0, n), 1.0, *rng.normal(size=(4, n, 2)), drive=None
    )
    numbers = {'kind': kind, 'v': 1.3, 'reach': 0.8, 'start': 2.0, 'end': 5.0, 'hz': 0.7,
               'source_v': 0.6, 'a': 0.3}  # fmt: skip
    column = Unlisted(0, numbers | {'source': 'b'}, names).columns(motion, None, None)
    (action,) = UNKNOWN[kind](0, numbers | {'source': 1}, names)
    for i in range(n):
        seen = Moment(motion.time[i], motion.position[i], motion.velocity[i], motion.effort[i],
                      np.zeros(0))  # fmt: skip
        drive = motion.effort[i, 0]
        added = action.force(seen) if action.force else action.drive(seen) - drive
        assert 0.3 * column[i, 0] == pytest.approx(added, abs=1e-12)
    assert np.abs(column).max() > 0.0


def test_the_share_runs_from_the_nominal_error_to_that_of_the_best_possible():
    """Clipped on both sides; where there is hardly anything to gain there is no share."""
    assert share(0.5, 0.5, 0.1) == 0.0
    assert share(0.5, 0.2, 0.1) == pytest.approx(0.75)
    assert share(0.5, 0.05, 0.1) == 1.0
    assert share(0.5, 9.0, 0.1) == -1.0
    assert share(0.5, 0.4, 0.4995) is None
    assert share(0.5, 0.4, 0.7) is None


def test_a_diagnosis_better_than_the_fitted_true_structure_is_counted():
    """So are the worlds where the true structure gains nothing, by name."""

    def row(case, diagnosed, oracle):
        e = {'nominal': 0.5, 'diagnosed': diagnosed, 'oracle': oracle}
        return {
            'case': case, 'truth': [['backlash', 'j']], 'verdict': 'missing_physics',
            'said': 'missing_physics', 'found': [], 'right': True, 'seconds': 1.0,
            'errors': dict.fromkeys(scoring.HELD_OUT, e),
            'improvement': dict.fromkeys(
                scoring.HELD_OUT, share(0.5, diagnosed, oracle)
            ),
            'improvement_of_truth': dict.fromkeys(
                scoring.HELD_OUT, share(0.5, diagnosed, 0.0)
            ),
        }  # fmt: skip

    rows = [row('one', 0.0, 0.1), row('two', 0.3, 0.1), row('three', 0.4, 0.6)]
    found = scoring.summary(rows)['improvement']['real_far']
    assert (found['above'], found['largest']) == (1, pytest.approx(1.25))
    assert found['not_scored'] == {'three': 'backlash'}
    assert found['below_nine_tenths'] == {'two': 'backlash'}
    assert (found['of_oracle']['worlds'], found['of_truth']['worlds']) == (2, 3)
    assert found['of_oracle']['mean'] == pytest.approx(0.75)
