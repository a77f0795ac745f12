"""The commands as functions: the same objects and the same files."""

from __future__ import annotations

import json

import pytest

import sgp_ros as sgp
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.errors import RecordingError

FRICTION = 'coulomb_friction:joint=pendulum,level=0.3'


@pytest.fixture(scope='module')
def real(tmp_path_factory):
    """A pendulum with more dry friction than its file states."""
    folder = tmp_path_factory.mktemp('real')
    return sgp.simulate('simple_pendulum', folder, effects=[FRICTION], duration=12.0)


@pytest.fixture(scope='module')
def diagnosed(real):
    """Diagnosis of the real pendulum."""
    return sgp.diagnose(real, robot='simple_pendulum')


@pytest.mark.long
def test_a_diagnosis_is_an_object_with_findings_and_figures(diagnosed, capsys):
    """Nothing is printed; it shows itself in a notebook with verdict, robot and numbers."""
    assert capsys.readouterr().out == ''
    first = diagnosed.findings[0]
    assert (first.joint, first.effect) == ('pendulum', 'coulomb_friction')
    assert diagnosed.verdict == 'missing_physics'
    assert str(diagnosed).startswith('Missing on pendulum')
    shown = diagnosed._repr_html_()
    assert '<svg class="robot"' in shown
    assert 'Coulomb friction' in shown
    assert diagnosed.plot('law').axes
    with pytest.raises(sgp.errors.ConfigError, match='one of'):
        diagnosed.plot('hologram')


@pytest.mark.long
def test_it_writes_the_files_of_the_command(diagnosed, tmp_path):
    """The page, the content of diagnosis.json, and a robot that can be loaded."""
    assert diagnosed.save(tmp_path).is_file()
    content = json.loads((tmp_path / 'diagnosis.json').read_text())
    assert set(content.pop('check')) == {'simple_pendulum'}
    assert content == json.loads(json.dumps(diagnosis_mapping(diagnosed.result)))
    assert sgp.load_robot(str(tmp_path / 'robot_diagnosed.yaml')).joint_names == ('pendulum',)


def test_an_identified_robot_has_parameters_with_intervals(real, tmp_path):
    """By name, as the command prints them."""
    found = sgp.identify(real, robot='simple_pendulum', inputs=['own:velocity'])
    friction = found.parameters['Fc']
    assert abs(friction.value - (0.1839 + 0.3)) < 4.0 * friction.std  # of the file, and beside it
    assert 'Fc' in found._repr_html_()
    assert found.plot().axes
    assert found.save(tmp_path).is_file()


def test_bad_input_raises_what_the_command_prints(tmp_path):
    """An error with what was found, expected and to be done."""
    with pytest.raises(RecordingError, match='no recording at'):
        sgp.diagnose(tmp_path / 'nothing.mcap', robot='simple_pendulum')
    with pytest.raises(AttributeError, match='frobnicate'):
        sgp.frobnicate  # noqa: B018 - the name alone is asked for
