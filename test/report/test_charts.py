"""Data that a page draws: thinned curves, maps, and a robot whose joints are where they are."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sgp_ros.report.charts import Chart, Series, embedded_data, kept
from sgp_ros.report.diagnosis import render
from sgp_ros.report.diagnosis_charts import diagnosis_charts
from sgp_ros.report.law_search import beyond_sentence, search_chart
from sgp_ros.report.robot_picture import LEVELS, robot_picture
from sgp_ros.rigid.tree import read_urdf
from test.report.diagnoses import COULOMB, LEVEL, OFF, UNKNOWN, diagnosis, search
from test.report.pages import charts_of, content_of

ARM = """
<robot name="arm"><link name="base"/><link name="upper"><inertial><mass value="1"/>
<origin xyz="0 0 -0.3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<link name="fore"><inertial><mass value="1"/><origin xyz="0 0 -0.2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="&lt;shoulder&gt;" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="elbow" type="prismatic"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 -0.6"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint></robot>"""


@given(arrays.arrays(float, st.integers(2, 400), elements=st.floats(-1e3, 1e3)),
       st.integers(8, 50))  # fmt: skip
def test_thinning_keeps_the_greatest_and_the_least_value(values, most):
    """Peaks are not thinned away, and rows stay in order."""
    rows = kept([values], most)
    assert values[rows].max() == values.max()
    assert values[rows].min() == values.min()
    assert (np.diff(rows) > 0).all()
    assert len(rows) <= max(most, 4) + 2


def test_what_is_no_number_reaches_the_page_as_a_break():
    """JSON has no NaN, and no text ends the script that it stands in."""
    chart = Chart(
        'a', 'b', '</script>', 'y', np.arange(2.0), [Series('s', np.array([1, np.nan]), 'final')]
    )
    text = embedded_data({'c': chart})
    assert '[1.0,null]' in text
    assert '<' not in text


def test_the_page_of_a_diagnosis_draws_each_model_over_what_acted():
    """The lack of the nominal robot is the difference of two curves that lie over each other."""
    found = replace(diagnosis('missing_physics', [COULOMB]), overlays={})
    charts = charts_of(render(found, {}))
    effort = {s['label']: np.array(s['y'], float) for s in charts['effort elbow']['series']}
    gap = np.abs(effort['nominal robot'] - effort['acted'])
    assert np.nanmedian(gap) == pytest.approx(LEVEL, rel=0.05)
    assert np.nanmedian(np.abs(effort['diagnosed robot'] - effort['acted'])) < 0.1 * LEVEL
    assert charts['effort elbow']['group'] == charts['left elbow']['group'] == 'train'
    before, after = (charts[f'map {when} elbow']['cells'] for when in ('before', 'after'))
    assert before['reach'] == after['reach']


def test_motion_is_shown_beside_efforts_with_its_errors_in_degrees():
    """A replay in which a model diverges is not the one that is seen first, and says so."""
    page = render(diagnosis('missing_physics', [COULOMB]), {})
    charts = charts_of(page)
    names = [name for name in charts if name.startswith('motion elbow ')]
    assert names == ['motion elbow open_0.5', 'motion elbow open_2', 'motion elbow error']
    off = charts['motion elbow error']['series'][0]['y']
    assert np.nanmedian(np.array(off, float)) == pytest.approx(OFF)
    assert {charts[n]['group'] for n in (*names, 'effort elbow')} == {'motion'}
    text = content_of(page)
    assert f'off by {OFF} rad ({math.degrees(OFF):.2g}°) rms' in text
    assert 'The nominal robot diverges' in text
    assert text.count('<td>diverges</td>') == 4  # both joints of both recordings
    assert re.search(
        r'>5.7 → 0.057°</strong>rms error of the position of elbow on real_test', text
    )
    nominal = np.array(charts['motion elbow open_2']['series'][1]['y'], float)
    assert 0.4 < np.isfinite(nominal).mean() < 0.6


@pytest.mark.parametrize('why_not', ['', 'the best formula follows the force only approximately'])
def test_the_search_for_a_law_is_drawn_and_said(why_not):
    """Data, shape with its band, formulas; asserted or not, and never both."""
    found = diagnosis('unexplained', [UNKNOWN])
    found = replace(found, law_searches=(search(why_not),))
    page = render(found, {})
    chart, text = charts_of(page)['search elbow'], content_of(page)
    assert [s['label'] for s in chart['series']] == [
        'measured', 'shape without a formula', 'formula 1'
    ]  # fmt: skip
    assert 'low' in chart['series'][1]
    assert 'data-chart="search elbow"' in text
    assert ('No formula is asserted' in text) == bool(why_not)
    assert ('Formula 1 is asserted' in text) == (not why_not)
    assert 'a = 0.1 N m/rad², d = 0.2 N m' in text.replace('\u00a0', ' ')


@pytest.mark.parametrize('verdict', ['no_mismatch', 'parameters_only', 'unexplained'])
def test_every_chart_says_what_is_seen_and_stands_on_the_page(verdict):
    """Also for those who do not see it; a model that was not needed is not drawn."""
    found = diagnosis(verdict, [UNKNOWN] if verdict == 'unexplained' else [])
    page = content_of(render(found, {}))
    for name, chart in diagnosis_charts(found).items():
        assert f'data-chart="{name}"' in page
        assert chart.said.endswith('.')
        if verdict == 'no_mismatch':
            assert not any('diagnosed' in s.label for s in chart.series)


def test_the_robot_is_drawn_with_its_joints_and_their_shares():
    """The joint with all of the mismatch has the strongest colour; names bring no markup."""
    tree = read_urdf(ARM)
    picture = robot_picture(tree, np.array([0.3, 0.1]), {'<shoulder>': 0.0, 'elbow': 1.0})
    assert picture.count('class="joint') == 2
    assert f'class="joint share{LEVELS - 1}"' in picture[picture.index('<rect') :]
    assert 'elbow 100 %' in picture
    assert '&lt;shoulder&gt; 0 %' in picture
    assert 'shoulder>' not in picture


def test_what_nothing_supports_is_said_as_such():
    """One value where formulas agree beyond what was seen, their span where they part."""
    one = search()
    said = beyond_sentence(one)
    assert 'this formula gives 0.6 N m at -2 rad and 0.6 N m at 2 rad' in said
    other = replace(one.formulas[0], beyond=0.2 + 0.1 * np.abs(one.beyond_x))
    both = replace(one, formulas=(*one.formulas, other))
    assert 'fit as well give 0.4 to 0.6 N m at -2 rad' in beyond_sentence(both)
    unlike = replace(one, formulas=(replace(one.formulas[0], is_alike=False),))
    assert beyond_sentence(unlike) == ''
    series = {x.label: x.y for x in search_chart(one).series}
    assert np.isfinite(series['formula 1']).all()
    assert np.isnan(series['measured']).any()
