"""The table of permitted imports, and what no module may do."""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

import pytest

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.joint_terms import term_laws

PACKAGE = Path(__file__).parents[1] / 'sgp_ros'
MODULES = sorted(PACKAGE.rglob('*.py'))
PROOF = PACKAGE.parent / 'sgp_proof'
PROOF_MODULES = sorted(PROOF.rglob('*.py'))

NUMERIC = {'numpy', 'scipy'}
MESSAGES = {
    'builtin_interfaces', 'diagnostic_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rclpy',
    'sensor_msgs', 'std_msgs', 'std_srvs', 'trajectory_msgs',
}  # fmt: skip
LAYERS = {
    'errors': set(),
    'optional': {'errors'},
    'gp': NUMERIC | {'numba', 'errors'},
    'physics': {'numpy', 'numba', 'errors'},
    'strangers': {'errors'},
    'markup': {'yaml', 'strangers', 'errors'},
    'apart': {'strangers', 'errors'},
    'scratch': set(),
    'rigid': NUMERIC | {
        'numba', 'pinocchio', 'clarabel', 'gp', 'physics', 'markup', 'strangers', 'errors',
    },
    'robots': {
        'numpy', 'yaml', 'physics', 'rigid', 'optional', 'apart', 'markup', 'strangers', 'errors',
    },
    'simulation': NUMERIC | {
        'mujoco', 'physics.catalogue', 'physics.effect', 'physics.effect_at', 'physics.example',
        'physics.parts', 'physics.place', 'physics.law', 'physics.grammar', 'physics.formula',
        'physics.tool_law', 'rigid', 'optional',
        'errors',
    },
    'engine': {'numpy', 'numba', 'gp', 'physics', 'rigid', 'robots', 'errors'},
    'batch': NUMERIC | {
        'numba', 'gp', 'physics', 'rigid', 'robots', 'engine', 'errors',
    },
    'recordings': {
        'numpy', 'scipy', 'yaml', 'rosbags', 'mcap', 'lz4', 'zstandard', 'engine.samples',
        'engine.results', 'optional', 'apart', 'scratch', 'markup', 'strangers', 'errors',
    },
    'diagnosis': NUMERIC | {
        'numba', 'gp', 'physics', 'rigid', 'robots', 'engine', 'batch', 'errors',
    },
    'campaign': NUMERIC | {'gp.scores', 'recordings.table_files', 'optional', 'errors'},
    'report': {
        'numpy', 'matplotlib', 'jinja2', 'markupsafe', 'gp', 'physics', 'rigid', 'robots',
        'engine', 'batch', 'diagnosis', 'campaign', 'strangers', 'errors',
    },
    'ros': MESSAGES | {
        'optional', 'report.layouts', 'report.verdict', 'report.diagnosis_text',
        'numpy', 'yaml', 'engine', 'physics', 'robots', 'simulation', 'diagnosis', 'recordings',
        'markup', 'strangers', 'errors',
    },
    'apps': {
        'numpy', 'yaml', 'matplotlib', 'gp', 'physics', 'rigid', 'robots', 'simulation', 'engine',
        'batch', 'recordings', 'diagnosis', 'campaign', 'report', 'optional', 'scratch',
        'strangers', 'errors',
    },
    'cli': {'apps', 'argcomplete', 'errors'},
}  # fmt: skip
"""Layer to what it may import beside the standard library, itself and the package's version."""

PROOF_ROOMS = {
    'result_files': set(),
    'columns': set(),
    'commands': set(),
    'unchanged': {'result_files'},
    'long_tests': {'result_files'},
    'bench': {'result_files', 'concealed', 'campaign'},
    'paper': {'columns'},
    'real': {'result_files', 'columns'},
    'streams': {'result_files', 'paper', 'real', 'concealed'},
    'numerics': {'result_files', 'bench', 'streams'},
    'concealed': {'result_files', 'paper'},
    'connection': {'result_files', 'concealed'},
    'robustness': {'result_files', 'streams'},
    'campaign': {'result_files'},
}
"""Room of the proof to the other ones that it may import, beside every layer of the product."""

SUB_ROOMS = {
    'diagnosis': (
        'criteria', 'shown', 'result', 'compare', 'setup', 'explain', 'locate', 'decide',
        'unlisted', 'findings', 'wrong_bodies', 'prove', 'mapping', 'gathered', 'connected',
        'refining', 'connecting', 'disturbed', 'common_structure', 'reference', 'pipeline',
    ),
    'robots': (
        'entries', 'shipped', 'listing', 'gains', 'models', 'observed_motion', 'nominal_prior',
        'stated_laws', 'stated_effects', 'effect_terms', 'bodies', 'robot', 'lumped',
        'urdf_robot', 'registry', 'given_bodies', 'stated_values', 'nominal', 'bare', 'exports',
    ),
}  # fmt: skip
"""Layer to its sub-rooms in their order: each imports itself and those that stand before it."""

PURE = ('gp', 'physics', 'rigid', 'engine', 'robots', 'simulation', 'batch')
SILENT = ('errors', 'optional', *PURE, 'recordings', 'diagnosis', 'campaign')
IMPURE_MODULES = {
    'asyncio', 'concurrent', 'datetime', 'multiprocessing', 'os', 'random', 'secrets', 'socket',
    'subprocess', 'threading', 'time', 'uuid',
}  # fmt: skip
FORBIDDEN = {'pickle', 'marshal', 'shelve', 'dill'}
LONGEST_MODULE, LONGEST_FUNCTION = 300, 50
SHORTEST_MODULE = 60
"""A module with fewer lines that one other module alone imports belongs into that one."""


def each(paths):
    """Make the check of one module a test of several, which names all that fail."""
    paths = list(paths)

    def failure(check, path):
        try:
            check(path)
        except AssertionError as error:
            return f'{path.relative_to(PACKAGE.parent)}: {error}'
        return ''

    def of_all(check):
        def test():
            failed = [text for path in paths if (text := failure(check, path))]
            assert not failed, '\n'.join(failed)

        test.__name__, test.__doc__ = check.__name__, check.__doc__
        return test

    return of_all


def _layer(path):
    parts = path.relative_to(PACKAGE).with_suffix('').parts
    return parts[0]


def _imports(path):
    for node in _nodes(path, ast.Import, ast.ImportFrom):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node
        else:
            assert node.level == 0, f'relative import in line {node.lineno}'
            yield node.module, node


@cache
def _tree(path):
    return ast.parse(path.read_text(encoding='utf-8'))


@cache
def _all_nodes(path):
    """Return the nodes of a module by their type, of one walk for all tests."""
    by_type = {}
    for node in ast.walk(_tree(path)):
        by_type.setdefault(type(node), []).append(node)
    return by_type


def _nodes(path, *types):
    return [node for kind in types for node in _all_nodes(path).get(kind, ())]


@pytest.fixture(scope='module', autouse=True)
def _forgotten():
    """Leave no trees that the garbage collector searches in all later tests."""
    yield
    for remembered in (_texts, _all_nodes, _tree):
        remembered.cache_clear()


@cache
def _texts(path):
    """Return the strings of a module that are no docstrings."""
    docstrings = {id(node.value) for node in _nodes(path, ast.Expr)}
    return {
        node.value
        for node in _nodes(path, ast.Constant)
        if isinstance(node.value, str) and id(node) not in docstrings
    }


def test_files_of_strangers_are_read_through_one_door():
    """`strangers.read_text` refuses pipes and what is too large; the others read their own."""
    own = {'strangers.py', 'page.py', 'live_processes.py', 'campaign.py', 'cli.py'}
    found = {path.name for path in MODULES if '.read_text(' in path.read_text(encoding='utf-8')}
    assert found == own


@each(MODULES)
def test_imports_follow_the_table(path):
    """Dependencies point down; imports are absolute."""
    layer = _layer(path)
    if layer == '__init__':
        return
    permitted = LAYERS[layer]
    for name, node in _imports(path):
        parts = name.split('.')
        if parts[0] == 'sgp_ros':
            if len(parts) == 1 or parts[1] == layer:
                continue
            target, fine = parts[1], '.'.join(parts[1:])
            known = target in permitted or any(
                fine == p or fine.startswith(f'{p}.') for p in permitted
            )
        else:
            known = parts[0] in sys.stdlib_module_names or parts[0] in permitted
            known = known or (parts[0] == 'typing_extensions')
        assert known, f'{layer} imports {name} in line {node.lineno}'


@each(PROOF_MODULES)
def test_rooms_of_the_proof_follow_their_table(path):
    """The product never imports the proof, by the table of layers; its rooms do so in order."""
    room = path.relative_to(PROOF).with_suffix('').parts[0]
    if room == '__init__':
        return
    for name, node in _imports(path):
        parts = name.split('.')
        if parts[0] == PROOF.name:
            assert parts[1] in {room, *PROOF_ROOMS[room]}, f'{name} in line {node.lineno}'


@each(MODULES)
def test_sub_rooms_look_back_only(path):
    """As the stages of a diagnosis, none of which needs what comes after it."""
    layer, *within = path.relative_to(PACKAGE).with_suffix('').parts
    order = SUB_ROOMS.get(layer, ())
    if not order or within == ['__init__']:
        return
    before = order[: order.index(within[0]) + 1]
    for name, node in _imports(path):
        parts = name.split('.')
        if parts[:2] == ['sgp_ros', layer]:
            assert parts[2] in before, f'{within[0]} imports {name} in line {node.lineno}'


def test_every_layer_with_folders_has_an_order():
    """A folder within a layer could hide a circle; rooms of the proof have none."""
    inner = [p.relative_to(PACKAGE).parts for p in MODULES]
    assert {parts[0] for parts in inner if len(parts) > 2} == set(SUB_ROOMS)
    assert all(len(p.relative_to(PROOF).parts) <= 2 for p in PROOF_MODULES)


@each([*MODULES, *PROOF_MODULES])
def test_no_module_unpickles_or_evaluates(path):
    """Model and robot files are data."""
    assert not {name.split('.')[0] for name, _ in _imports(path)} & FORBIDDEN
    for node in _nodes(path, ast.Call):
        called = node.func
        name = called.id if isinstance(called, ast.Name) else getattr(called, 'attr', '')
        assert name not in {'eval', 'exec', 'unsafe_load', 'full_load'}, node.lineno
        if name == 'load' and getattr(getattr(called, 'value', None), 'id', '') == 'np':
            given = {k.arg: getattr(k.value, 'value', None) for k in node.keywords}
            assert given.get('allow_pickle') is False, node.lineno


@each(p for p in MODULES if _layer(p) in SILENT)
def test_no_module_below_the_report_logs_or_prints(path):
    """Counts and flags are returned; who calls decides how to tell them."""
    assert not {name.split('.')[0] for name, _ in _imports(path)} & {'logging', 'warnings'}
    for node in _nodes(path, ast.Call):
        if isinstance(node.func, ast.Name):
            assert node.func.id not in {'print', 'input'}, node.lineno
    for node in _nodes(path, ast.Attribute):
        if node.attr in {'stdout', 'stderr'}:
            assert ast.unparse(node) not in {'sys.stdout', 'sys.stderr'}, node.lineno


@each(p for p in MODULES if _layer(p) in PURE)
def test_the_fold_is_pure(path):
    """No clock, thread, environment, file or unseeded generator below the recordings."""
    assert not {name.split('.')[0] for name, _ in _imports(path)} & IMPURE_MODULES
    for node in _nodes(path, ast.Call):
        if isinstance(node.func, ast.Name):
            assert node.func.id != 'open', node.lineno
        if isinstance(node.func, ast.Attribute):
            if node.func.attr == 'default_rng':
                assert node.args, f'generator without a seed in line {node.lineno}'
            assert not (
                isinstance(node.func.value, ast.Attribute)
                and node.func.value.attr == 'random'
                and node.func.attr in {'rand', 'randn', 'normal', 'uniform', 'seed'}
            ), node.lineno


@each(PROOF_MODULES)
def test_modules_of_the_proof_stay_short(path):
    """A script may list what it does in one function, but a module has one subject."""
    assert path.read_text(encoding='utf-8').count('\n') <= LONGEST_MODULE


@each(MODULES)
def test_modules_and_functions_stay_short(path):
    """Past this length a reader loses the thread; `__init__` files hold a docstring alone."""
    text = path.read_text(encoding='utf-8')
    assert text.count('\n') <= LONGEST_MODULE
    for node in _nodes(path, ast.FunctionDef, ast.AsyncFunctionDef):
        docstring = ast.get_docstring(node) or ''
        body = node.end_lineno - node.lineno - docstring.count('\n')
        assert body <= LONGEST_FUNCTION, node.name


def _said(path):
    """Return the dotted names in strings."""
    return {word for text in _texts(path) for word in re.findall(r'[\w.]+', text)}


def test_a_short_module_serves_more_than_one_other():
    """The counterweight to the longest module: nothing is split for its length alone.

    A module that a string names, as a command its function, is imported by who says it; an
    executable that is installed is one of its own.
    """
    paths = [p for p in (*MODULES, *PROOF_MODULES) if p.name != '__init__.py']
    names = {'.'.join(p.relative_to(PACKAGE.parent).with_suffix('').parts): p for p in paths}
    importers = {name: set() for name in names}
    for name, path in names.items():
        for node in _nodes(path, ast.ImportFrom):
            if node.module:
                whole = {node.module, *(f'{node.module}.{a.name}' for a in node.names)}
                for imported in whole & names.keys():
                    importers[imported].add(name)
        for imported in _said(path) & names.keys():
            importers[imported].add(name)
    lonely = {
        name
        for name, path in names.items()
        if len(importers[name]) == 1 and path.read_text().count('\n') < SHORTEST_MODULE
    }
    assert not lonely - _said(PACKAGE.parent / 'setup.py')


@each([*MODULES, *PROOF_MODULES])
def test_imports_are_plain(path):
    """No block for type checkers alone, in which circles hide."""
    assert 'TYPE_CHECKING' not in path.read_text(encoding='utf-8')


@each([*MODULES, *PROOF_MODULES])
def test_no_function_takes_the_name_of_another(path):
    """The first one of a module would be lost."""
    names = [x.name for x in _tree(path).body if isinstance(x, (ast.FunctionDef, ast.ClassDef))]
    assert len(names) == len(set(names)), names


@each([*MODULES, *PROOF_MODULES])
def test_every_module_says_what_it_is_for(path):
    """The docstring's first line is one sentence."""
    docstring = ast.get_docstring(_tree(path))
    assert docstring, path
    assert docstring.split('\n\n')[0].rstrip().endswith(('.', '?')), docstring


@pytest.mark.parametrize('folder', ['sgp_ros', 'sgp_proof', 'docs', 'test'])
def test_docstrings_begin_with_the_thing_itself(folder):
    """No text that stands alone begins with "What": neither a docstring nor one of a constant."""
    found = [
        (path.name, node.lineno)
        for path in sorted((PACKAGE.parent / folder).rglob('*.py'))
        for node in _nodes(path, ast.Expr)
        if isinstance(node.value, ast.Constant) and str(node.value.value).startswith('What')
    ]
    assert not found


def _named(path):
    """Return names in strings: one that stands alone or before a colon, or has several words."""
    texts = _texts(path)
    words = {word for text in texts for word in re.findall(r'\w+:?', text)}
    return texts | {word.rstrip(':') for word in words if word[-1] == ':' or '_' in word}


def test_no_effect_is_named_outside_physics_and_simulation():
    """All facts about a law follow from its value, so that a new law is one value.

    `payload` is also a key of a robot YAML, `viscous_friction` one of Isaac Lab.
    """
    scanned = [p for p in MODULES if _layer(p) not in {'physics', 'simulation'}]
    scanned += [*PROOF_MODULES, *(PACKAGE.parent / 'docs').glob('*.py')]
    keys = {('robots', 'payload'), ('exports', 'viscous_friction')}
    found = {(path, name) for path in scanned for name in _named(path) & set(EFFECTS)}
    assert not {(path, name) for path, name in found if (path.parent.name, name) not in keys}


def test_no_term_is_named_outside_physics():
    """The terms of a robot YAML are laws too; an `offset` others have as well."""
    terms = set(term_laws()) - {'offset', *EFFECTS}
    scanned = [p for p in MODULES if _layer(p) not in {'physics', 'simulation'}]
    assert not {(path, name) for path in scanned for name in _named(path) & terms}


def test_names_are_found_within_texts(tmp_path):
    """As on a command line; plain words such as a spring are none."""
    path = tmp_path / 'some.py'
    text = """'Of coulomb_friction.'\nx = 'a spring', f'--effect end_stop:joint={1}'\n"""
    path.write_text(text, encoding='utf-8')
    assert _named(path) & set(EFFECTS) == {'end_stop'}
