"""The findings of an identification are plain data, and the page shows these and no others."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from sgp_ros.batch.blocks import distance_to
from sgp_ros.batch.identification import IdentificationOptions, identify
from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.errors import NumericalError
from sgp_ros.report.findings import collect_findings, far_half
from sgp_ros.report.identification import draw_filter, draw_prediction, picture_of, render
from sgp_ros.report.identification_text import cautions, excitation, verdict
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import moved_axis
from test.report.pages import content_of

LINEAR_AXIS = load_robot('linear_axis')
AXIS = """
<robot name="axis"><link name="base"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axis" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture(scope='module')
def found():
    return identify(moved_axis(0, duration=15.0), LINEAR_AXIS, {}, IdentificationOptions())


@pytest.fixture(scope='module')
def findings(found):
    return collect_findings(found, 'axis.mcap', {}, {'states on the grid': 3000})


@pytest.fixture
def changed(findings):
    """A copy that a test may change."""
    return copy.deepcopy(findings)


class _Cells(HTMLParser):
    """Texts of table cells by row, and the addresses that a page refers to."""

    def __init__(self, page):
        super().__init__()
        self.rows, self.addresses, self._is_cell = [], [], False
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in {'src', 'href'}]
        starts = tag in {'td', 'th'}
        self._is_cell = starts or (self._is_cell and tag == 'small')
        if tag == 'tr':
            self.rows.append([])
        if starts:
            self.rows[-1].append('')

    def handle_endtag(self, tag):
        self._is_cell = self._is_cell and tag not in {'td', 'th'}

    def handle_data(self, data):
        if self._is_cell:
            self.rows[-1][-1] += data


def _page(findings, remarks=(), description='An axis'):
    said = {**findings, 'remarks': list(remarks)}
    return render(description, said, {'filter': b'png', 'prediction_held_out': b'png'})


def _numbers(value):
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return [x for each in value for x in _numbers(each)]
    return [value] if isinstance(value, float) else []


def test_findings_are_json_without_nan(findings):
    assert json.loads(json.dumps(findings, allow_nan=False)) == findings
    assert all(math.isfinite(x) for x in _numbers(findings))


def test_numbers_of_which_no_error_is_finite_are_refused(found):
    lost = tuple(replace(c, regret=math.nan, error=math.nan) for c in found.choice.candidates)
    wrong = replace(found, choice=replace(found.choice, candidates=lost))
    with pytest.raises(NumericalError, match='no low-pass leaves a finite error'):
        collect_findings(wrong, 'axis.mcap', {}, {})


def test_scores_are_those_of_the_predictions(found, findings):
    """Recomputed from the fits by their definitions."""
    for method, fit in found.fits.items():
        for name, data in {'train': found.train, **found.held}.items():
            mean, variance = fit.predict(data)
            score = findings['scores'][method][name]['joints']['axis']
            error = data.y - mean
            assert score['nmse'] == pytest.approx(np.mean(error**2) / np.var(data.y))
            assert score['rmse'] == pytest.approx(np.sqrt(np.mean(error**2)))
            inside = np.abs(error) < 1.959964 * np.sqrt(variance)
            assert score['coverage95'] == pytest.approx(inside.mean())


def test_near_and_far_divide_the_held_out_rows_in_halves(found, findings):
    rows = findings['rows']
    for name in findings['held_out']:
        near, far = rows[f'{name}, near'], rows[f'{name}, far']
        assert near + far == rows[name]
        assert 0 <= near - far <= 1
    assert rows['train'] + sum(rows[name] for name in findings['held_out']) == len(found.data.time)


@pytest.mark.parametrize('n', [0, 1, 2, 7])
def test_rows_at_equal_distance_are_divided_too(found, n):
    """Copies of one row: neither half takes them all."""
    known = found.train
    copies = FilteredData(*(np.repeat(x[:1], n, axis=0) for x in (
        known.time, known.U, known.F, known.y)), known.rate, np.zeros(n, dtype=int))  # fmt: skip
    assert far_half(known, copies).sum() == n // 2


def test_far_rows_lie_further_than_near_ones(found):
    data = found.held['held out']
    is_far = far_half(found.train, data)
    distance = distance_to(found.train, data)
    assert distance[is_far].min() >= distance[~is_far].max()


def test_a_constant_target_has_no_nmse_and_the_page_shows_none(changed):
    """The effort of a passive joint is zero: an error over no variance is no number."""
    for regions in changed['scores'].values():
        for region in regions.values():
            region['joints']['axis']['nmse'] = None
            region['mean_nmse'] = None
    assert 'nothing of the held-out part' in verdict(changed)
    rows = [row for row in _Cells(_page(changed)).rows if row and row[0] == 'axis']
    assert rows
    assert all(row[2] == '' for row in rows)


def test_the_page_refers_to_nothing_outside_itself(findings):
    page = _page(findings)
    assert _Cells(content_of(page)).addresses


def test_every_text_is_escaped(changed):
    """Names come from files of others."""
    bad = '<script>alert(1)</script>'
    changed['recording'] = bad
    changed['parameters'][0]['name'] = bad
    changed['excitation']['suggestions'] = [bad]
    page = content_of(_page(changed, [bad], bad))
    assert bad not in page
    assert page.count('&lt;script&gt;alert(1)') >= 5


def test_parameters_of_the_page_are_those_of_the_findings(findings):
    """Value to five digits and the 95 % interval, with its unit."""
    rows = {row[0]: row for row in _Cells(_page(findings)).rows if len(row) == 4}
    for p in findings['parameters']:
        low, high = (p['value'] + sign * 1.959964 * p['std'] for sign in (-1, 1))
        cells = f'{p["value"]:.5g}', f'{low:.4g} to {high:.4g}', p['unit']
        assert rows[p['name'] + p['meaning']][1:4] == list(cells)


def test_scores_of_the_page_are_those_of_the_findings(findings):
    """A row for each region and method, what is held out first; its error has a unit."""
    rows = [row for row in _Cells(_page(findings)).rows if row and row[0] == 'axis']
    regions = sorted(findings['rows'], key=lambda name: name not in findings['held_out'])
    expected = [
        [method, f'{s["nmse"]:.3g}', f'{100 * s["coverage95"]:.0f} %', f'{s["rmse"]:.3g} N']
        for region in regions for method, of in findings['scores'].items()
        for s in [of[region]['joints']['axis']]
    ]  # fmt: skip
    assert [row[1:] for row in rows] == expected


def test_the_page_draws_the_robot_and_says_errors_in_units_first(found, findings):
    """An axis has all of what the physics alone leaves."""
    picture = picture_of(found, findings, read_urdf(AXIS))
    assert 'axis 100 %' in picture
    assert 'share of the residual of the physics alone' in picture
    page = render('', findings, {}, picture=picture)
    physics, both = (findings['scores'][m]['held out']['joints']['axis']['rmse']
                     for m in ('PR', 'SGP'))  # fmt: skip
    assert f'<strong>{physics:.3g} → {both:.3g} N</strong>' in page
    assert picture in page


def test_a_good_identification_gets_no_caution(findings):
    assert cautions(findings) == []
    assert 'would not predict better' in verdict(findings)


@pytest.mark.parametrize(
    ('place', 'value', 'said'),
    [
        (('filter',), {'is_white': False, 'residual_autocorrelation': 0.6}, 'not white'),
        (('consistency',), {'was_consistent': False, 'distance': 9.0}, '3 standard deviations'),
        (('consistency',), {'was_consistent': False, 'distance': None}, 'no URDF is written'),
    ],
)
def test_what_is_not_to_be_trusted_is_said(changed, place, value, said):
    *path, last = place
    inner = changed
    for key in path:
        inner = inner[key]
    inner[last] = {**(inner[last] or {}), **value}
    assert said in ' '.join(cautions(changed))
    assert said in _page(changed)


def test_a_correlation_that_white_noise_has_by_chance_is_no_alarm(changed):
    """Of some hundred rows, below three of its standard deviations."""
    rows = max(c['rows'] for c in changed['filter']['candidates'])
    changed['filter'] |= {'is_white': False, 'residual_autocorrelation': 2.0 / rows**0.5}
    assert cautions(changed) == []


def test_narrow_intervals_are_said_of_held_out_data_only(changed):
    sgp = changed['scores']['SGP']
    sgp['train']['joints']['axis']['coverage95'] = 0.5
    assert cautions(changed) == []
    sgp['held out']['joints']['axis']['coverage95'] = 0.5
    assert 'too narrow' in cautions(changed)[0]


def test_what_is_not_excited_is_named(changed):
    changed['excitation'] |= {'rank': 3, 'not_excited': ['Fc + 2 M']}
    assert 'determines 3 combinations of parameters, of 4' in excitation(changed['excitation'])
    assert 'Not determined: Fc + 2 M.' in excitation(changed['excitation'])


def test_figures_show_what_is_held_out_in_its_unit(found, findings):
    figure = draw_prediction(found, 'held out')
    assert figure.axes[0].get_ylabel() == 'axis\n[N]'
    shown = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(shown, found.held['held out'].y[: len(shown), 0])
    lines = draw_filter(findings['filter']).axes[0].lines
    assert len(lines[0].get_xdata()) == len(findings['filter']['candidates'])
