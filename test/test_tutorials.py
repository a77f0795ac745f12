"""The tutorials run as they are written, and say what happens then.

Blocks whose first line is `# file: NAME` are written to NAME. Lines of `bash` blocks that begin
with `sgp` are commands, `python` blocks are run one after the other; `text` blocks are not run.
"""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from sgp_ros.cli import main

DOCS = Path(__file__).parents[1] / 'docs'
BLOCK = re.compile(r'^```(\w+)\n(.*?)^```', re.DOTALL | re.MULTILINE)


def run(name):
    """Write, run and call what a page says, in the current folder."""
    names = {}
    for language, text in BLOCK.findall((DOCS / 'tutorials' / f'{name}.md').read_text('utf-8')):
        first, _, rest = text.partition('\n')
        if first.startswith('# file: '):
            Path(first.removeprefix('# file: ')).write_text(rest, encoding='utf-8')
        elif language == 'python':
            exec(compile(text, name, 'exec'), names)
        elif language == 'bash':
            for line in text.replace('\\\n', ' ').splitlines():
                assert main(shlex.split(line, comments=True)[1:]) == 0, line


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def _found(folder='out/diagnose'):
    content = json.loads(Path(folder, 'diagnosis.json').read_text())
    return content, {(f['joint'], f['effect']): f['parameters'] for f in content['findings']}


def test_a_pendulum_in_a_csv_file():
    """Dry friction of the machine that made the table, within a tenth."""
    run('pendulum_csv')
    _, found = _found()
    level = found['angle', 'coulomb_friction']['level']['value']
    assert level == pytest.approx(0.3, rel=0.1)


@pytest.mark.long
def test_an_arm_with_urdf_and_bag():
    """The fault of its elbow is found, proved on the other recording, and handed back."""
    run('arm_bag')
    content, found = _found()
    assert found['elbow', 'coulomb_friction']['level']['value'] == pytest.approx(0.25, rel=0.1)
    proof = content['fit']['other']
    assert proof['nmse_after']['elbow'] < 0.05 * proof['nmse_before']['elbow']
    text = Path('out/export/arm.urdf').read_text()
    friction = [float(x) for x in re.findall(r'<dynamics[^>]*friction="([\d.]+)"', text)]
    assert max(friction) == pytest.approx(0.25, rel=0.1)


@pytest.mark.long
def test_a_mujoco_model_and_a_log_of_its_drives():
    """The damping that MuJoCo had beyond that of the file, and its sum in the corrected file."""
    run('mujoco')
    _, found = _found()
    assert found['elbow', 'viscous_friction']['b']['value'] == pytest.approx(0.5, rel=0.1)
    text = next(Path('out/export').glob('*.xml')).read_text()
    damping = re.search(r'<joint[^>]*name="elbow"[^>]*damping="([\d.]+)"', text)
    assert float(damping[1]) == pytest.approx(0.6, rel=0.1)


def test_a_law_of_ones_own(capsys):
    """It is listed with its words and units."""
    run('own_law')
    assert 'an eddy-current brake' in capsys.readouterr().out


def test_a_robot_of_formulas():
    """Simulated and identified: its mass is what the file says."""
    run('extending')
    parameters = json.loads(Path('out/replay/metrics.json').read_text())['parameters']
    mass = next(p for p in parameters if p['name'] == 'M')
    assert abs(mass['value'] - 20.0) < 4.0 * mass['std']


@pytest.mark.long
def test_the_notebook_runs_from_top_to_bottom():
    """Cell by cell; the last one has written the report."""
    cells = json.loads((DOCS / 'notebook.ipynb').read_text('utf-8'))['cells']
    names = {}
    for cell in cells:
        if cell['cell_type'] == 'code':
            exec(compile(''.join(cell['source']), cell['id'], 'exec'), names)
    assert names['d'].findings[0].effect == 'coulomb_friction'
    assert Path('out/notebook/diagnosis/report.html').is_file()


def test_the_robot_files_of_the_package_and_of_the_pages_fit_the_schema():
    """Each has only keys that one of the kinds knows; an editor complains of nothing."""
    import yaml

    kinds = json.loads((DOCS / 'reference' / 'robot.schema.json').read_text())['anyOf']
    texts = [p.read_text() for p in (DOCS.parent / 'config' / 'robots').glob('*.yaml')]
    for page in (DOCS / 'tutorials').glob('*.md'):
        texts += [
            text for language, text in BLOCK.findall(page.read_text('utf-8'))
            if language == 'yaml' and '\nschema: 1' in text
        ]  # fmt: skip
    assert len(texts) > 5
    for text in texts:
        document = yaml.safe_load(text)
        assert any(
            set(kind['required']) <= document.keys() <= kind['properties'].keys() for kind in kinds
        ), text
