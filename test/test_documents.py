"""The documents: links lead somewhere, and no number was typed that a result file holds."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pytest

import sgp_ros
from sgp_proof.concealed.promises import FACTOR
from sgp_ros.cli import _parser
from sgp_ros.diagnosis.result import VERDICTS
from sgp_ros.physics.catalogue import EFFECTS

ROOT = Path(__file__).parents[1]
COMMANDS = set(_parser([]).summaries)
DOCUMENTS = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md')])


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda p: p.name)
def test_relative_links_lead_to_files(path):
    """Every link that is no address is a file of this repository."""
    text = path.read_text(encoding='utf-8')
    for target in re.findall(r'\]\(([^)#]+)(?:#[^)]*)?\)', text):
        if '://' not in target:
            assert (path.parent / target).exists(), f'{path.name}: {target}'


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda p: p.name)
def test_commands_in_documents_exist(path):
    """`sgp NAME` and `make NAME` in a code block are commands of this version."""
    text = path.read_text(encoding='utf-8')
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    targets = set(re.findall(r'^(\w+):', makefile, re.MULTILINE))
    for block in re.findall(r'```(?:bash|console)\n(.*?)```', text, re.DOTALL):
        for name in re.findall(r'^\s*(?:\$ )?(?:\S*/)?sgp (\w+)', block, re.MULTILINE):
            assert name in COMMANDS, name
        for name in re.findall(r'^\s*(?:\$ )?make (\w+)', block, re.MULTILINE):
            assert name in targets, name


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda p: p.name)
def test_modules_named_in_documents_exist(path):
    """Paths in backticks are files below the repository, the package or its tests."""
    text = path.read_text(encoding='utf-8')
    folders = (ROOT, ROOT / 'sgp_ros')
    for name in re.findall(r'`((?:\w+/)+\w+\.(?:py|yaml|urdf|md))`', text):
        if not name.startswith('out/'):
            assert any((folder / name).is_file() for folder in folders), f'{path.name}: {name}'
    for name in re.findall(r'python -m (sgp_proof[\w.]*)', text):
        file = ROOT / name.replace('.', '/')
        assert file.with_suffix('.py').is_file(), f'{path.name}: {name}'


def test_the_glossary_explains_every_verdict():
    """The table has the verdicts of a diagnosis, in their order."""
    text = (ROOT / 'docs/glossary.md').read_text(encoding='utf-8')
    table = text.split('The verdict is one of')[1].split('##')[0]
    assert tuple(re.findall(r'^\| `(\w+)`', table, re.MULTILINE)) == VERDICTS


def test_numbers_in_the_filter_page_are_the_measured_ones():
    """The table is that of the committed result."""
    result = json.loads((ROOT / 'sgp_proof/results/filter.json').read_text(encoding='utf-8'))
    text = (ROOT / 'docs/filter.md').read_text(encoding='utf-8')
    for row in result['median_relative_error'].values():
        assert ' | '.join(f'{100 * x:.2f}' for x in row) in text


def test_what_a_diagnosis_promises_is_delivered_on_the_practice_cases():
    """Within a factor of two, but for what the page names."""
    path = ROOT / 'sgp_proof/results/promises.json'
    cases = json.loads(path.read_text(encoding='utf-8'))['cases']
    missed = {
        (name, joint)
        for name, case in cases.items()
        for joint, x in case['effort_nmse'].items()
        if x['delivered'] > FACTOR * x['promised']
    }
    assert missed == set()


def test_numbers_in_the_emps_page_are_the_measured_ones():
    """Values, intervals and errors are those of the committed result."""
    result = json.loads((ROOT / 'sgp_proof/results/emps.json').read_text(encoding='utf-8'))
    text = (ROOT / 'docs/emps.md').read_text(encoding='utf-8')
    for parameter in result['parameters'].values():
        assert f'{parameter["value"]:.3f} | ± {1.96 * parameter["std"]:.3f}' in text
    for record in ('identification_record', 'validation_record_frozen'):
        errors = result[record]
        assert (
            f'{errors["inverse_nmse_physics"]:.5f} | {errors["inverse_nmse_with_z"]:.5f}' in text
        )


def test_numbers_in_the_identifiability_page_are_the_measured_ones():
    """Coverage and flags are those of the committed result."""
    path = ROOT / 'sgp_proof/results/trees.json'
    found = json.loads(path.read_text(encoding='utf-8'))['all']
    text = (ROOT / 'docs/identifiability.md').read_text(encoding='utf-8')
    assert (
        f'| {found["trees"]} | {found["base_parameters"]} | {100 * found["coverage95_base"]:.1f} %'
        f' | {found["unidentifiable_directions"]} | {found["directions_missed"]}'
        f' | {found["directions_false"]} |'
    ) in text


def test_numbers_in_the_page_of_pendulums_are_the_measured_ones():
    """Every row of the two tables is that of the committed results."""
    text = (ROOT / 'docs/pendulums.md').read_text(encoding='utf-8')
    folder = ROOT / 'sgp_proof' / 'results'
    double = json.loads((folder / 'double_pendulum.json').read_text(encoding='utf-8'))
    for design, result in double['designs'].items():
        for name, row in result['held_out'].items():
            assert row['diverged'] == 0, name
            if name.startswith('published model_1.0'):
                continue
            cells = (row[f'nmse_{kind}'] for kind in ('path', 'end'))
            cells = (' / '.join(f'{x:.4f}' for x in cell) for cell in cells)
            assert f'| {" | ".join(cells)} |' in text, (design, name)
    simple = json.loads((folder / 'simple_pendulum.json').read_text(encoding='utf-8'))
    for recording in simple['recordings'].values():
        for model in recording['whole'].values():
            cells = [model['in_sample'], *model['held_out'].values()]
            cells = (f'{cell["whole"]["rms_path_rad"][0]:.4f}' for cell in cells)
            assert f'| {" | ".join(cells)} |' in text


@pytest.mark.parametrize(
    'name', sorted(p.stem.removeprefix('generate_') for p in (ROOT / 'docs').glob('generate_*.py'))
)
def test_generated_pages_are_those_of_code_and_results(name):
    """Mend with `python docs/generate_<name>.py`."""
    path = ROOT / 'docs' / f'generate_{name}.py'
    spec = importlib.util.spec_from_file_location(f'generate_{name}', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    pages = module.pages() if hasattr(module, 'pages') else {module.TARGET: module.text()}
    for target, text in pages.items():
        assert target.read_text(encoding='utf-8') == text, target.name


def test_the_tests_that_take_long_have_passed():
    """Each that is marked stands in the committed result of `make proofs`."""
    path = ROOT / 'sgp_proof' / 'results' / 'long_tests.json'
    tests = json.loads(path.read_text(encoding='utf-8'))['tests']
    assert {test['outcome'] for test in tests} == {'passed'}
    ran = {(test['file'], test['test'].split('[')[0]) for test in tests}
    marked = set()
    for file in (ROOT / 'test').rglob('test_*.py'):
        text = file.read_text(encoding='utf-8')
        is_whole = re.search(r'^pytestmark = pytest\.mark\.long$', text, re.MULTILINE)
        mark = '' if is_whole else r'^@pytest\.mark\.long\n(?:[@ )].*\n)*'
        names = re.findall(rf'{mark}^def (test_\w+)', text, re.MULTILINE)
        marked |= {(str(file.relative_to(ROOT)), name) for name in names}
    assert len(marked) > 30
    assert marked <= ran


def test_each_real_machine_has_a_page_with_every_picture_of_its_report():
    """No picture is taken that nobody sees, and none is shown of a report that lacked it."""
    path = ROOT / 'sgp_proof' / 'results' / 'real_diagnosis.json'
    machines = json.loads(path.read_text(encoding='utf-8'))['machines']
    pages, pictures = ROOT / 'docs' / 'real_machines', ROOT / 'docs' / 'images' / 'real_machines'
    assert {page.stem for page in pages.iterdir()} == set(machines)
    assert {folder.name for folder in pictures.iterdir()} == set(machines)
    for name, machine in machines.items():
        text = (pages / f'{name}.md').read_text(encoding='utf-8')
        shown = re.findall(rf'\]\(\.\./images/real_machines/{name}/(\w+)\.png\)', text)
        assert (
            sorted(shown)
            == machine['pictures']
            == sorted(picture.stem for picture in (pictures / name).iterdir())
        )


def test_pictures_of_effects_are_those_of_their_laws():
    """Every effect that exerts a force has one, drawn from its law; to a fifth of a pixel."""
    path = ROOT / 'docs/effect_pictures.py'
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = module.pictures()
    assert set(drawn) == {name for name, law in EFFECTS.items() if law.is_force}
    assert set(drawn) == {file.stem for file in module.TARGET.glob('*.svg')}
    number = r'-?\d+\.\d'
    for name, picture in drawn.items():
        committed = (module.TARGET / f'{name}.svg').read_text(encoding='utf-8')
        new, old = (np.array(re.findall(number, x), float) for x in (picture, committed))
        assert abs(len(new) - len(old)) <= 8, name  # neighbours that round to one point are one
        if len(new) == len(old):
            assert np.abs(new - old).max() <= 0.2, name


def test_the_site_states_its_version_and_its_changes():
    """In its header and on a page; the changelog of ROS is reStructuredText."""
    pytest.importorskip('mkdocs', reason='no MkDocs: pip install sgp_ros[docs]')
    path = ROOT / 'docs/site_hooks.py'
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.on_config({'site_name': 'a'})['site_name'] == f'a {sgp_ros.__version__}'
    text = module.markdown((ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8'))
    assert text.startswith('# Changelog for sgp_ros\n')
    assert re.search(rf'^## {re.escape(sgp_ros.__version__)}\b', text, re.MULTILINE)
    assert '### Added' in text
    assert '``' not in text
    assert '~~~~' not in text
