"""What a page draws from: thinned curves, maps, and a robot whose joints are where they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sgp_ros.report.charts import Chart, Series, embedded_data, kept
from sgp_ros.report.diagnosis import render
from sgp_ros.report.diagnosis_charts import diagnosis_charts
from sgp_ros.report.robot_picture import LEVELS, robot_picture
from sgp_ros.rigid.tree import read_urdf
from test.report.diagnoses import COULOMB, LEVEL, UNKNOWN, diagnosis
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
    """What stands out is not thinned away, and rows stay in order."""
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
    """What the nominal robot lacks is the difference of two curves that lie over each other."""
    found = diagnosis('missing_physics', [COULOMB])
    charts = charts_of(render(found, {}))
    effort = {s['label']: np.array(s['y'], float) for s in charts['effort elbow']['series']}
    gap = np.abs(effort['nominal robot'] - effort['acted'])
    assert np.nanmedian(gap) == pytest.approx(LEVEL, rel=0.05)
    assert np.nanmedian(np.abs(effort['diagnosed robot'] - effort['acted'])) < 0.1 * LEVEL
    assert charts['effort elbow']['group'] == charts['left elbow']['group'] == 'train'
    before, after = (charts[f'map {when} elbow']['cells'] for when in ('before', 'after'))
    assert before['reach'] == after['reach']


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
