"""The file that shows a finding in PlotJuggler, Lichtblick and Foxglove, read back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from sgp_ros.apps.finding_file import marked_rows, write_finding
from sgp_ros.diagnosis.result import Location
from sgp_ros.recordings.reader import open_recording
from sgp_ros.rigid.tree import read_urdf
from test.report.diagnoses import COULOMB, diagnosis
from test.report.test_charts import ARM as MARKED

ARM = MARKED.replace('&lt;', '').replace('&gt;', '')
START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope='module')
def written(tmp_path_factory):
    """Return a diagnosis whose finding has a region, and its file."""
    found = diagnosis('missing_physics', [COULOMB])
    position = found.traces.position[:, found.joints.index(COULOMB.joint)]
    low, high = (float(x) for x in np.quantile(position, (0.4, 0.6)))
    place = Location(('position',), {'position': [[low, high]]}, ((1.0, 2.0),))
    found = replace(found, findings=(replace(COULOMB, location=place),))
    path = tmp_path_factory.mktemp('finding') / 'finding.mcap'
    write_finding(path, found, read_urdf(ARM), START_NS)
    return found, path, (low, high)


def test_residuals_and_band_are_those_of_the_diagnosis(written):
    found, path, _ = written
    recording = open_recording(path)
    for topic, expected in (('nominal', found.traces.before), ('final', found.traces.after)):
        messages = [m for _, m in recording.messages(f'/finding/residual/{topic}')]
        assert list(messages[0].name) == list(found.joints)
        np.testing.assert_array_equal([m.effort for m in messages], expected)
    upper = [m.effort for _, m in recording.messages('/finding/band/upper')]
    inside = np.mean(np.abs(found.traces.after) <= np.array(upper))
    assert 0.9 < inside <= 1.0


@pytest.mark.parametrize(('seconds', 'rate_hz'), [(60.0, 20.0), (1000.0, 4.0)])
def test_the_robot_is_drawn_less_often_in_a_long_recording(seconds, rate_hz):
    time = np.arange(0.0, seconds, 0.02)
    rows = marked_rows(time)
    assert np.diff(time[rows]) == pytest.approx(1.0 / rate_hz, abs=0.021)
    assert len(rows) == pytest.approx(seconds * rate_hz, abs=1)


def test_links_have_the_colour_of_their_share(written):
    """The joint with most of the mismatch is the reddest; lines end at the joints."""
    found, path, _ = written
    messages = [m for _, m in open_recording(path).messages('/finding/markers')]
    seconds = found.traces.time[-1] - found.traces.time[0]
    assert len(messages) == pytest.approx(20.0 * seconds, abs=2)
    marks = {m.ns: m for m in messages[0].markers}
    green = {name: mark.color.g for name, mark in marks.items()}
    left = found.proofs['train'].nmse_before
    worst = max(found.joints, key=lambda joint: left[joint])
    tree = read_urdf(ARM)
    link = tree.link_names[tree.joint_names.index(worst)]
    assert min(green, key=green.get) == link
    assert all(len(mark.points) == 2 for mark in marks.values())


def test_events_say_where_and_when_a_region_is_entered(written):
    found, path, (low, high) = written
    joint = found.joints.index(COULOMB.joint)
    entries = [(t, m) for t, m in open_recording(path).messages('/finding/events')]
    enters = [t for t, m in entries if 'enters position' in m.msg]
    assert enters
    for stamp_ns in enters:
        i = int(np.argmin(np.abs(found.traces.time - (stamp_ns - START_NS) * 1e-9)))
        assert low <= found.traces.position[i, joint] <= high
    times = [(t - START_NS) * 1e-9 for t, m in entries if m.msg.endswith(('begins', 'ends'))]
    np.testing.assert_allclose(times, [1.0, 2.0], atol=0.05)


def test_indexed_and_linear_readers_agree(written):
    """The file is whole, for tools of either kind."""
    _, path, _ = written
    with path.open('rb') as file:
        summary = make_reader(file).get_summary()
        count = summary.statistics.message_count
    with path.open('rb') as file:
        linear = [r for r in StreamReader(file).records if type(r).__name__ == 'Message']
    assert count == len(linear) > 0
