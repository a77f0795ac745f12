"""Laws of the pictures of the process Z and of what is called significant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.report.diagnosis import render
from sgp_ros.report.diagnosis_figures import draw_diagnosis
from sgp_ros.report.diagnosis_maps import band_sentences, draw_bands
from test.report.diagnoses import COULOMB, LEVEL, LOCAL, diagnosis

REACH = {'shoulder': 0.5, 'elbow': 0.5}


def _axes(figure, joint, variable):
    rows = [axes for axes in figure.axes if axes.get_xlabel().startswith(variable)]
    return rows[list(REACH).index(joint)]


def test_both_directions_are_drawn_with_their_bands_on_one_scale():
    """And nothing where the joint never moved so."""
    found = diagnosis('missing_physics', [COULOMB])
    figure = draw_bands(found, REACH)
    assert len(figure.axes) == 6
    axes = _axes(figure, 'elbow', 'position')
    backward, forward = (line.get_ydata() for line in axes.lines[:2])
    assert backward[2:] == pytest.approx(LEVEL)
    assert forward == pytest.approx(-LEVEL)
    assert (backward[:2] != backward[:2]).all()
    assert len(axes.collections) == 2
    assert {a.get_ylim() for a in figure.axes} == {(-0.5, 0.5)}


def test_regions_are_shaded_and_said_significant():
    found = diagnosis('missing_physics', [COULOMB])
    figure = draw_bands(found, REACH)
    ends = [
        (box.get_x(), box.get_x() + box.get_width())
        for box in _axes(figure, 'elbow', 'velocity').patches
    ]
    assert np.array(ends) == pytest.approx(np.array([(-2.0, -0.5), (0.5, 2.0)]))
    assert not _axes(figure, 'shoulder', 'velocity').patches
    (legend,) = figure.legends
    words = sorted(text.get_text() for text in legend.get_texts())
    assert words == ['backward', 'forward', 'significant']
    assert _axes(figure, 'elbow', 'velocity').get_title() == 'significant (p 0.005)'
    assert _axes(figure, 'elbow', 'time').get_title() == 'not significant (p 0.7)'


def test_the_region_of_a_finding_is_marked_beside_the_band():
    """Also one in time."""
    figure = draw_bands(diagnosis('missing_physics', [LOCAL]), REACH)
    (box,) = _axes(figure, 'elbow', 'position').patches
    assert (box.get_x(), box.get_x() + box.get_width()) == pytest.approx((-0.4, 0.1))
    burst = replace(LOCAL, location=replace(LOCAL.location, intervals={}, time=((3.0, 5.0),)))
    figure = draw_bands(diagnosis('missing_physics', [burst]), REACH)
    (box,) = _axes(figure, 'elbow', 'time').patches
    assert box.get_x() == pytest.approx(3.0)


def test_each_joint_is_said_with_the_region_of_its_best_variable():
    found = diagnosis('missing_physics', [COULOMB])
    quiet, loud = band_sentences(found, ['shoulder', 'elbow'])
    assert quiet == 'shoulder: nowhere significant.'
    assert loud == 'elbow: at velocity from -2 to -0.5 rad/s and 0.5 to 2 rad/s, 80 % of the rows.'
    assert loud in render(found, {'bands': b''})


def test_a_recording_without_bands_has_no_picture_of_them():
    """Too few rows."""
    found = replace(diagnosis('missing_physics', [COULOMB]), bands=())
    assert 'bands' not in draw_diagnosis(found)
    assert band_sentences(found, ['elbow']) == []
