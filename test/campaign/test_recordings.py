"""Which recordings a campaign has, and what a table tells of them."""

from __future__ import annotations

import math

import pytest

from sgp_ros.apps.campaign_task import mean_of_topic
from sgp_ros.campaign.recordings import TableRow, find_recordings, read_covariates
from sgp_ros.engine.samples import CommandSample, frozen_array
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.command_types import FLOAT64, FLOAT64_ARRAY
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter


@pytest.fixture
def bags(tmp_path):
    for name in ('a/1.mcap', 'a/2.bag', 'b/split/metadata.yaml', 'b/split/0.mcap', 'b/1.mcap',
                 'notes.txt', '.hidden/3.mcap'):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def test_a_folder_is_searched_and_a_rosbag2_directory_is_one(bags):
    found = find_recordings([str(bags)])
    assert list(found) == ['a/1.mcap', 'a/2.bag', 'b/1.mcap', 'b/split']
    assert found['b/split'] == (bags / 'b' / 'split').resolve()


@pytest.mark.parametrize(
    ('places', 'names'),
    [
        (['**/1.mcap'], ['a/1.mcap', 'b/1.mcap']),
        (['a/*'], ['1.mcap', '2.bag']),
        (['a/1.mcap'], ['1.mcap']),
        (['a', 'b/split'], ['a/1.mcap', 'a/2.bag', 'b/split']),
        (['b/split'], ['split']),
    ],
)
def test_patterns_and_several_places_are_named_from_what_they_share(bags, places, names):
    assert list(find_recordings([str(bags / place) for place in places])) == names


@pytest.mark.parametrize('place', ['nothing', '*.mcap', '.hidden/*.txt'])
def test_nothing_is_refused(bags, place):
    with pytest.raises(RecordingError):
        find_recordings([str(bags / place)])


def test_a_table_tells_of_recordings_by_name_or_stem(tmp_path):
    table = tmp_path / 'bags.csv'
    table.write_text(
        'recording,robot,time,temperature,operator,payload\n'
        'a/1.mcap,left,2026-05-04T12:00:00,31.5,Ann,\n'
        '2,right,2026-05-04T14:00:00+02:00,20,Bob,1.5\n'
        'gone.mcap,left,5,1,Ann,1\n'
    )
    remarks: list[str] = []
    rows = read_covariates(str(table), ('a/1.mcap', 'b/1.mcap', 'b/2.mcap'), remarks)
    noon = 1777896000.0
    assert rows['a/1.mcap'] == TableRow('left', '', noon, {'temperature': 31.5})
    assert rows['b/2.mcap'] == TableRow('right', '', noon, {'temperature': 20.0, 'payload': 1.5})
    assert rows['b/1.mcap'] == TableRow()
    assert any('gone.mcap' in said for said in remarks)
    assert any('no row for 1 of 3' in said for said in remarks)
    assert any('operator' in said for said in remarks)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('bag,robot\n1,left\n', 'a column recording'),
        ('recording,robot\n1,left\n1.mcap,left\n', 'in two rows'),
        ('recording,time\n1,yesterday\n', 'yesterday'),
    ],
)
def test_a_table_that_says_nothing_sure_is_refused(tmp_path, text, said):
    (tmp_path / 'bags.csv').write_text(text)
    with pytest.raises(ConfigError, match=said):
        read_covariates(str(tmp_path / 'bags.csv'), ('1.mcap',), [])


def test_the_mean_of_a_topic_is_a_covariate(tmp_path):
    """Of one number a message; a message of several has none."""
    for name, kind in (('one', FLOAT64), ('more', FLOAT64_ARRAY)):
        with RecordingWriter(tmp_path / f'{name}.mcap', command_type=kind) as writer:
            for i, value in enumerate((20.0, 24.0, math.nan)):
                writer.write_event(CommandSample(10**9 * (1 + i), frozen_array([value])))
    assert mean_of_topic(open_recording(tmp_path / 'one.mcap'), '/command') == 22.0
    for name, topic in (('more', '/command'), ('one', '/temperature')):
        with pytest.raises(RecordingError, match=topic):
            mean_of_topic(open_recording(tmp_path / f'{name}.mcap'), topic)
