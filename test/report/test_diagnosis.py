"""Laws of the page and the sentences of a diagnosis."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_hex

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.diagnosis.result import Equivalent, Finding, Location, Parameter
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.report.diagnosis import render, write_diagnosis
from sgp_ros.report.diagnosis_figures import (
    BY_CHANCE,
    FORCES,
    draw_dependence,
    draw_diagnosis,
    draw_laws,
    draw_proof,
    draw_time,
)
from sgp_ros.report.diagnosis_maps import draw_location, important_joints
from sgp_ros.report.diagnosis_text import (
    effect_name,
    equivalence_sentence,
    explained,
    percent,
    plain_name,
    quantity,
    visibility_sentences,
)
from sgp_ros.report.page import typeset
from sgp_ros.report.verdict import held_out_sentence, verdict_sentence
from test.report.diagnoses import (
    ASYMMETRIC,
    COULOMB,
    LOCAL,
    MASS,
    NOISE,
    SPRING,
    UNKNOWN,
    N,
    diagnosis,
)
from test.report.pages import content_of

SIX = ('base_yaw', 'shoulder', 'elbow', 'wrist_1', 'wrist_2', 'wrist_3')


def test_missing_physics_is_said_with_joint_name_interval_probability_and_gain():
    """All an engineer asks for first, in one sentence."""
    assert verdict_sentence(diagnosis('missing_physics', [COULOMB])) == (
        'Missing on elbow: Coulomb friction, level 0.3170 +- 0.0020 N m (probability 0.99); '
        'it explains more than 99.9 % of the residual of the nominal robot.'
    )


def test_what_could_not_have_shown_is_said_in_words_and_numbers():
    """A line for each effect; what no size would show is null in the file."""
    seen = {
        ('shoulder', 'backlash', 'gap'): Parameter(0.00213, None, 'rad'),
        ('elbow', 'backlash', 'gap'): Parameter(math.inf, None, 'rad'),
    }
    found = replace(diagnosis('no_mismatch'), visibility=seen)
    assert visibility_sentences(found) == [
        'backlash: below 0.00213 rad on shoulder, of any size on elbow'
    ]
    assert 'What this recording could not have shown' in render(found, {})
    entries = diagnosis_mapping(found)['visibility']
    assert [e['value'] for e in entries] == [0.00213, None]
    assert entries[0].keys() == {'joint', 'effect', 'parameter', 'value', 'unit'}


def test_both_effects_of_a_pair_are_said_with_their_joints():
    """On one joint it is not repeated; corrected bodies share the credit."""
    two = verdict_sentence(diagnosis('missing_physics', [COULOMB, SPRING]))
    assert 'on elbow: Coulomb friction' in two
    assert 'on shoulder: a spring' in two
    assert 'together they explain' in two
    same = verdict_sentence(diagnosis('missing_physics', [COULOMB, LOCAL], errors=[MASS]))
    assert same.count('on elbow') == 1
    assert 'viscous friction in a part of the range, from -0.400 to 0.100 +- 0.020 rad' in same
    assert 'with corrected bodies they explain' in same


def test_an_effect_belongs_to_the_joint_named_last_before_it():
    """Back on an earlier joint that one is named again, or the effect would change its place."""
    back = verdict_sentence(diagnosis('missing_physics', [COULOMB, SPRING, LOCAL]))
    assert 'on shoulder: a spring' in back
    assert 'and on elbow: viscous friction in a part of the range' in back


def test_wrong_parameters_are_said_beside_the_nominal_ones():
    """Which body, how much, instead of what; and that nothing else is missing."""
    text = verdict_sentence(diagnosis('parameters_only', errors=[MASS]))
    assert 'No physics is missing' in text
    assert 'mass of fore 1.300 +- 0.039 kg instead of 1 kg' in text
    without = verdict_sentence(diagnosis('parameters_only'))
    assert 'combinations' in without


def test_no_mismatch_is_said_with_the_size_of_what_is_left():
    """As much as the encoder's noise, where that is so."""
    text = verdict_sentence(diagnosis('no_mismatch'))
    assert text.startswith('No mismatch: the residual of the nominal robot is')
    assert 'N m rms on' in text
    assert 'no more than the encoder noise explains (0.004 N m)' in text


def test_the_unexplained_is_said_with_what_it_depends_on_and_the_nearest_effect():
    """Nobody is left to think that something was named."""
    text = verdict_sentence(diagnosis('unexplained', [UNKNOWN], alternatives=[ASYMMETRIC]))
    assert text.startswith('Unexplained on elbow: 10 % of the mean squared effort')
    assert 'it depends on velocity (90 %) and position (10 %)' in text
    nearest = EFFECTS['asymmetric_coulomb'].words
    assert f'No listed effect is asserted; the nearest is {nearest}: {ASYMMETRIC.why}.' in text
    law = replace(ASYMMETRIC, effect='law', log_bayes_factor=1e3)
    beside = verdict_sentence(diagnosis('unexplained', [UNKNOWN], alternatives=[law, ASYMMETRIC]))
    assert beside == text  # a formula is no listed effect


def test_what_is_known_of_other_joints_is_said_after_the_unexplained():
    """The first sentence is the same as without."""
    alone = verdict_sentence(diagnosis('unexplained', [UNKNOWN], alternatives=[ASYMMETRIC]))
    found = diagnosis('unexplained', [COULOMB, UNKNOWN], alternatives=[ASYMMETRIC])
    before, after = verdict_sentence(found).split(' Missing beside it ')
    assert before == alone
    assert after.startswith('on elbow: Coulomb friction, level 0.3170')
    assert after.endswith('(probability 0.99).')


@pytest.mark.parametrize('name', [*EFFECTS, 'unknown'])
def test_every_effect_has_a_plain_name(name):
    """Nothing of the schema's spelling reaches the reader."""
    assert '_' not in plain_name(name)


def test_the_other_joint_of_an_effect_is_named():
    """With the kind of the effect where it has one."""
    for kind, words in (({}, 'with hip'), ({'kind': Parameter('torque')}, 'torque from hip')):
        parameters = {'source_joint': Parameter('hip'), **kind}
        found = Finding('knee', 'joint_coupling', parameters, Location(), 1.0, 0.9, 0.1, '')
        assert effect_name(found) == f'a coupling between joints ({words})'


def test_a_joint_called_base_is_not_the_base():
    """Nor is one called `tool` the tool."""
    pair = Equivalent((('base', 'spring'), ('base', 'gravity_tilt'), ('tool', 'unlisted')), '', 7)
    sentence = equivalence_sentence(pair)
    assert 'a spring on base, a base that is not level at the base and' in sentence
    assert 'on tool would' in sentence


@given(value=st.floats(-1e6, 1e6), std=st.floats(1e-9, 1e6))
def test_printed_digits_keep_a_number_well_inside_its_interval(value, std):
    """Rounding moves neither the value nor the half width by more than 5.1 % of the interval."""
    shown, half = quantity(Parameter(value, std, 'N m')).removesuffix(' N m').split(' +- ')
    allowed = max(0.051 * 1.96 * std, 0.5 if std > 5.0 else 0.0) + 1e-9 * abs(value)
    assert abs(float(shown) - value) <= allowed
    assert abs(float(half) - 1.96 * std) <= allowed


@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_share_below_one_is_never_called_all(share):
    """Something is always left."""
    assert percent(share) != '100 %'


def test_what_cannot_be_separated_is_said_with_the_motion_that_would(tmp_path):
    pair = Equivalent((('elbow', 'spring'), ('base', 'gravity_tilt')), 'a motion twice as wide', 7)
    sentence = equivalence_sentence(pair)
    assert 'a spring on elbow and a base that is not level at the base would' in sentence
    assert 'would fit equally well' in sentence
    assert 'a motion twice as wide separates them' in sentence
    assert ' 7 times' in sentence
    never = equivalence_sentence(Equivalent((), '', 1.0))
    assert 'another set of bodies would fit equally well; no motion tried' in never
    other = equivalence_sentence(pair, [('elbow', 'spring'), ('elbow', 'backlash')])
    assert 'motion a base that is not level at the base in place of backlash on elbow' in other
    more = equivalence_sentence(pair, [('elbow', 'spring')])
    assert 'motion a base that is not level at the base beside what is found would' in more
    found = replace(diagnosis('parameters_only'), equivalents=(pair,))
    write_diagnosis(tmp_path, found)
    assert sentence in (tmp_path / 'report.html').read_text()


def test_without_held_out_recordings_the_page_promises_nothing(tmp_path):
    """Data that were learned from prove little."""
    found = diagnosis('missing_physics', [COULOMB], held=False)
    write_diagnosis(tmp_path, found)
    assert held_out_sentence(found) in (tmp_path / 'report.html').read_text()
    assert 'No recording was held out' in held_out_sentence(found)


def test_the_page_opens_with_the_sentence_and_needs_no_other_file(tmp_path):
    """Verdict, then pictures, rivals, proof and refusals; every picture also stands alone."""
    found = diagnosis('missing_physics', [COULOMB], alternatives=[ASYMMETRIC], errors=[MASS])
    write_diagnosis(tmp_path, found)
    page = (tmp_path / 'report.html').read_text()
    order = (
        typeset(verdict_sentence(found)), '<h2>Where', '<h2>What', COULOMB.formula,
        'why they were rejected', '<h2>How much better', '<td>3</td><td class="text">duplicate',
    )  # fmt: skip
    at = [page.index(text) for text in order]
    assert at == sorted(at)
    content_of(page)
    stems = {path.stem for path in tmp_path.glob('*.png')}
    assert stems == {path.stem for path in tmp_path.glob('*.svg')}
    assert stems == {
        'location', 'others', 'time', 'bands', 'law', 'dependence', 'proof', 'motion'
    }  # fmt: skip
    assert page.count('src="data:image/png;base64,') == len(stems - {'dependence'})
    assert not list(tmp_path.glob('.sgp_growing_*'))


@pytest.mark.parametrize(
    ('verdict', 'findings'),
    [('parameters_only', ()), ('no_mismatch', ()), ('unexplained', (UNKNOWN,))],
)
def test_no_law_is_drawn_where_none_was_found(verdict, findings):
    """An unknown effect has no formula, a calm robot no force."""
    found = diagnosis(verdict, findings)
    figures = draw_diagnosis(found)
    assert 'law' not in figures
    assert {'location', 'time', 'proof'} <= figures.keys()


def test_the_unexplained_is_drawn_over_what_it_depends_on_most():
    """Every row once, forward and backward apart, so that an engineer can guess the law."""
    found = diagnosis('unexplained', [UNKNOWN])
    (axes,) = draw_diagnosis(found)['shape'].axes
    assert axes.get_xlabel().startswith('velocity')
    forward, backward = (line.get_xdata() for line in axes.lines[:2])
    assert (forward > 0.0).all()
    assert len(forward) + len(backward) == len(found.traces.time)


def test_what_may_be_chance_is_pale_and_in_no_sentence():
    found = diagnosis('unexplained', [UNKNOWN])
    assert 'velocity (90 %) and position (10 %)' in verdict_sentence(found)
    weak = tuple(
        replace(d, p_values={'position': 0.2, 'velocity': 0.005}) for d in found.dependences
    )
    found = replace(found, dependences=weak)
    sentence = verdict_sentence(found)
    assert 'velocity (90 %)' in sentence
    assert 'position' not in sentence
    (axes,) = draw_dependence(found, {'elbow'}).axes
    bars = {
        label.get_text(): to_hex(bar.get_facecolor()).upper()
        for label, bar in zip(axes.get_yticklabels(), axes.patches, strict=True)
    }
    assert bars['position'] == bars['time'] == BY_CHANCE
    assert bars['velocity'] != BY_CHANCE


def test_texts_from_outside_bring_no_markup():
    """Names of joints, remarks and formulas are escaped."""
    found = diagnosis('missing_physics', [COULOMB], joints=('<script>', 'elbow'))
    assert '&lt;script&gt;' in content_of(render(found, {}))


def test_before_and_after_share_one_scale():
    """Otherwise noise would look like physics."""
    figure = draw_location(diagnosis('missing_physics', [COULOMB]))
    before, after = (axes.collections[0].get_clim() for axes in figure.axes[:2])
    assert before == after
    assert before[0] == -before[1]


def test_maps_have_the_colours_that_the_page_names():
    """Blue below zero, orange above: in the picture, which is printed, as on the page."""
    found = diagnosis('missing_physics', [COULOMB])
    mesh = draw_location(found).axes[0].collections[0]
    low, high = mesh.get_clim()
    page = render(found, {})
    for name, value in (('below', low), ('zero', 0.0), ('above', high)):
        assert re.search(rf'--{name}: (#\w+)', page)[1] == to_hex(mesh.to_rgba(value))


def test_noise_is_not_drawn_as_physics():
    """Where nothing is missing, colours end at the least that would count."""
    found = diagnosis('no_mismatch')
    (low, high) = draw_location(found).axes[0].collections[0].get_clim()
    assert high == pytest.approx(LEAST_SHARE**0.5)  # the effort of this robot has unit size
    assert abs(found.traces.before).max() < 0.5 * high
    assert low == -high


def test_the_region_of_a_finding_is_drawn_in():
    """Its limits stand at the interval, on both maps."""
    figure = draw_location(diagnosis('missing_physics', [LOCAL]))
    for axes in figure.axes[:2]:
        (box,) = axes.patches
        assert (box.get_x(), box.get_x() + box.get_width()) == pytest.approx((-0.4, 0.1))


@pytest.mark.parametrize('name', [n for n, e in EFFECTS.items() if e.is_force])
def test_every_effect_is_drawn_over_what_it_depends_on(name):
    """Measurement and law, whatever the schema can name."""
    values = {q.name: Parameter(1.0, 0.1, q.unit) for q in EFFECTS[name].quantities}
    finding = replace(COULOMB, effect=name, parameters=values)
    (axes,) = draw_laws(diagnosis('missing_physics', [finding])).axes
    measured, law = (line.get_ydata() for line in axes.lines[:2])
    assert len(measured) == len(law) > 0
    assert abs(measured - law).max() < 6.0 * NOISE


def test_a_lag_of_the_velocity_claims_no_force():
    """The sensor is wrong, not the motion: nothing is explained by it, no law is drawn."""
    lag = replace(
        COULOMB, effect='velocity_filter_lag', parameters={'time_constant': Parameter(0.01, 1e-3)}
    )
    found = replace(diagnosis('no_mismatch'), verdict='missing_physics', findings=(lag,))
    assert 'explain' not in verdict_sentence(found)
    assert 'law' not in draw_diagnosis(found)
    assert 'of the variance of the velocity' in render(found, {})


def test_a_force_is_drawn_beside_its_own_finding():
    """Also where a finding without force is more probable."""
    alone = diagnosis('missing_physics', [COULOMB])
    lag = replace(
        COULOMB, effect='velocity_filter_lag', parameters={'time_constant': Parameter(0.01, 1e-3)}
    )
    (force,) = alone.traces.forces
    traces = replace(alone.traces, forces=(0.0 * force, force))
    both = replace(alone, findings=(lag, *alone.findings), traces=traces)
    laws = [draw_laws(found).axes[0].lines[1].get_ydata() for found in (alone, both)]
    assert abs(laws[0]).max() > 0.0
    assert (laws[0] == laws[1]).all()


def test_a_law_is_not_drawn_where_friction_holds_the_joint():
    """Friction takes up there what the law gives: neither is zero."""
    found = diagnosis('missing_physics', [COULOMB])
    moving = np.arange(len(found.traces.time)) % 4 > 0
    traces = replace(found.traces, moving=moving[:, None] & np.ones(len(found.joints), bool))
    law, measured = (line.get_ydata() for line in draw_laws(replace(found, traces=traces)).axes[0]
                     .lines[1::-1])  # fmt: skip
    assert (np.isfinite(law) == moving).all()
    assert (np.isfinite(measured) == moving).all()


def test_each_row_over_time_names_the_forces_it_shows():
    """In the colours of their laws, also where joints differ in what acts on them."""
    found = diagnosis('missing_physics', [COULOMB, SPRING])
    force = found.traces.forces[0]
    found = replace(found, traces=replace(found.traces, forces=(force, force[:, ::-1])))
    rows = [axes for axes in draw_time(found).axes if axes.get_legend() is not None]
    named = {}
    for axes in rows:
        (line,) = axes.get_legend().get_lines()
        named[axes.get_legend().get_texts()[0].get_text()] = line.get_color()
        assert line.get_color() in {drawn.get_color() for drawn in axes.lines}
    laws = {axes.get_title(): axes.lines[1].get_color() for axes in draw_laws(found).axes}
    assert named == laws == {'Coulomb friction': FORCES[0], 'a spring': FORCES[0]}


def test_no_line_joins_rows_with_a_pause_between_them():
    """Nothing is drawn where nothing was recorded."""
    found = diagnosis('missing_physics', [COULOMB])
    later = found.traces.time + 5.0 * (np.arange(N) >= N // 2)
    found = replace(found, traces=replace(found.traces, time=later))
    for axes in draw_time(found).axes[:1]:
        for line in (x for x in axes.lines if len(x.get_xdata()) == N):
            assert np.flatnonzero(np.isnan(line.get_ydata())).tolist() == [N // 2 - 1]


def test_few_rows_get_large_cells():
    """Or a map of twenty rows would be dust."""
    found = diagnosis('missing_physics', [COULOMB])
    t = found.traces
    rows = ('time', 'position', 'velocity', 'effort', 'before', 'parameters', 'after')
    few = {name: getattr(t, name)[::30] for name in rows}
    few = replace(found, traces=replace(t, **few, forces=tuple(x[::30] for x in t.forces)))
    sizes = [draw_location(f).axes[0].collections[0].get_array().size for f in (few, found)]
    assert sizes == [8**2, 24**2]


def test_a_chart_of_what_explains_nothing_says_so():
    """An empty frame would look like a fault."""
    found = diagnosis('missing_physics', [COULOMB])
    (axes,) = draw_dependence(found, {'elbow'}).axes
    assert not axes.texts
    nothing = tuple(replace(d, scores=dict.fromkeys(d.scores, 1e-16)) for d in found.dependences)
    (axes,) = draw_dependence(replace(found, dependences=nothing), {'elbow'}).axes
    assert [text.get_text() for text in axes.texts] == ['none of these alone']


def test_a_joint_that_is_never_driven_hides_no_finding():
    """Its error over the variance of its effort is no number; the other joints still speak."""
    found = diagnosis('missing_physics', [COULOMB])
    proof = found.proofs['train']
    wild = replace(
        proof,
        nmse_before=proof.nmse_before | {'shoulder': 1e290},
        nmse_after=proof.nmse_after | {'shoulder': math.nan},
    )
    found = replace(found, proofs={'train': wild, 'real_test': wild})
    assert explained(found) > 0.99
    assert important_joints(found) == [1]
    assert 'shoulder' not in held_out_sentence(found)
    assert len(draw_diagnosis(found)) == 8


def test_many_joints_stay_readable():
    """Large pictures go to the joint concerned; all others are small and named."""
    found = diagnosis('missing_physics', [COULOMB], joints=SIX)
    assert important_joints(found) == [SIX.index('elbow')]
    figures = draw_diagnosis(found)
    assert len(figures['others'].axes) == len(SIX)  # one is the scale of the colours
    assert all(figure.get_figheight() < 8.0 for figure in figures.values())
    labels = [text.get_text() for text in draw_proof(found).axes[0].get_yticklabels()]
    assert set(labels) == set(SIX)


def _text(page):
    """Return the text of a page with single spaces."""
    return ' '.join(re.sub('<[^>]+>', ' ', page).split())


def test_the_proof_tells_near_from_far_with_intervals_and_roll_outs():
    """In plain words: by how much of the way each model misses, and what is in no mean."""
    found = diagnosis('missing_physics', [COULOMB])
    text = _text(render(found, {}))
    assert 'deviations per coordinate: real_test 1.5' in text
    assert '0.0004 0.0003 to 0.0005' in text
    assert (
        'On real_test, the rms error of shoulder is 30 % of its travel for the nominal robot'
        in text
    )
    assert 'and 2 % of it for the diagnosed robot' in text
    assert 'learned from 40, real_test 40 (3 left out' in text
    assert 'real_test 1 (0.9 to 1.1) and -2 nat' in text


def test_an_effect_far_above_the_mismatch_says_that_others_cancel_it():
    """A share of 15 % where 1.5 % was left would look like an error of the page."""
    said = 'more than the nominal robot leaves: other effects or bodies cancel part of it'
    for share, is_said in ((50.0, True), (1e-3, False)):
        found = diagnosis('missing_physics', [replace(COULOMB, share=share)])
        assert (said in _text(render(found, {}))) == is_said


def test_a_proof_without_roll_outs_has_no_column_for_them():
    """And no sentence; the picture has one row less."""
    found = diagnosis('missing_physics', [COULOMB])
    bare = {
        stem: replace(proof, rollout_before={}, rollout_after={})
        for stem, proof in found.proofs.items()
    }
    page = content_of(render(replace(found, proofs=bare), {}))
    assert 'roll-outs of 0.3 s' not in page
    assert 'roll-outs of 0.3 s' in content_of(render(found, {}))
    assert len(draw_proof(found).axes) == 2 * len(draw_proof(replace(found, proofs=bare)).axes)


def test_whiskers_are_the_intervals_and_bars_end_at_the_errors():
    """Of the roll-outs of the final model, on every recording; recordings are named once."""
    figure = draw_proof(diagnosis('missing_physics', [COULOMB]))
    top, bottom = figure.axes[:2], figure.axes[2:]
    assert [axes.get_title() for axes in top] == ['learned from', 'real_test']
    for axes in bottom:
        assert all(tuple(line.get_xdata()) == (3e-4, 5e-4) for line in axes.get_lines())
        assert len(axes.get_lines()) == 2
        ends = [bar.get_x() + bar.get_width() for bar in axes.patches]
        assert sorted(ends) == pytest.approx([4e-4, 4e-4, 0.09, 0.09])


def test_the_part_that_was_held_out_is_called_so():
    """It is no recording of its own."""
    found = diagnosis('missing_physics', [COULOMB])
    found = replace(
        found, proofs={'train': found.proofs['train'], 'held_out': found.proofs['real_test']}
    )
    assert 'on the part held out (elbow)' in held_out_sentence(found)
    text = _text(render(found, {}))
    assert 'is left on elbow, the part held out' in text
    assert 'held_out' not in text


def test_what_the_simulation_lacks_stands_among_the_settings():
    """Where one was given."""
    found = diagnosis('missing_physics', [COULOMB])
    assert 'simulation' not in _text(render(found, {}))
    shown = replace(found, simulation={'shoulder': 2e-7, 'elbow': 0.12})
    assert 'shoulder less than 0.001 %, elbow 12 %' in _text(render(shown, {}))
