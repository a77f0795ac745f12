"""The file for the viewer Rerun, read back."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.apps.finding_rerun import rerun_package, write_rerun
from sgp_ros.diagnosis.result import Location
from sgp_ros.errors import ConfigError
from sgp_ros.rigid.tree import read_urdf
from test.apps.test_finding_file import ARM, START_NS
from test.report.diagnoses import COULOMB, diagnosis


def _columns(path):
    """Return values by entity, those of all its chunks one after the other."""
    reader = pytest.importorskip('rerun.chunk').RrdReader
    found = {}
    for chunk in reader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found.setdefault((chunk.entity_path, name), []).extend(batch[name])
    return found


def test_curves_links_and_events_are_those_of_the_diagnosis(tmp_path):
    pytest.importorskip('rerun')
    found = diagnosis('missing_physics', [COULOMB])
    place = Location(('position',), {}, ((1.0, 2.0),))
    found = replace(found, findings=(replace(COULOMB, location=place),))
    write_rerun(tmp_path / 'finding.rrd', found, read_urdf(ARM), START_NS)

    columns = _columns(tmp_path / 'finding.rrd')
    assert {path.name for path in tmp_path.iterdir()} == {'finding.rrd'}
    for j, joint in enumerate(found.joints):
        kept = [row.as_py() for row in columns[f'/residual/{joint}/final', 'Scalars:scalars']]
        np.testing.assert_array_equal(np.ravel(kept), found.traces.after[:, j])
    stamps = columns[f'/residual/{found.joints[0]}/final', 'time']
    assert stamps[0].value == START_NS + round(1e9 * found.traces.time[0])
    said = [row.as_py()[0] for row in columns['/events', 'TextLog:text']]
    assert any(text.endswith('begins') for text in said)
    labels = [row.as_py() for row in columns['/robot', 'LineStrips3D:labels']]
    assert all('%' in label for label in labels[0])


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'rerun', None)
    with pytest.raises(ConfigError, match=r"pip install 'sgp_ros\[rerun\]'") as error:
        rerun_package()
    assert '\n' not in str(error.value)
