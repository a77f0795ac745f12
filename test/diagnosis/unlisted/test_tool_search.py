"""The search for a law of the tool: a rope on an arm, and what is no such law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.apps.simulation import write_simulated
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.unlisted import at_tool
from sgp_ros.diagnosis.unlisted.at_tool import tool_remarks, with_tool_law
from sgp_ros.diagnosis.unlisted.tool_search import is_asked, tool_law_of, tool_models
from sgp_ros.physics.catalogue import VISCOUS_FRICTION
from sgp_ros.physics.tool_law import tool_point
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree_simulator import tree_simulator
from test.physics.test_tool_law import URDF, stated

ROPE = {'ax': 0.05, 'ay': 0.0, 'az': 0.1, 'px': 0.8, 'py': 0.5, 'pz': 1.6}


def recorded(folder, effects):
    """Return the equations of a simulated recording of the arm, and how its models compare."""
    (folder / 'robot.urdf').write_text(URDF, encoding='utf-8')
    found = simulate(make_simulation(tree_simulator(URDF), effects=effects, seed=3), 20.0)
    write_simulated(found, folder / 'real.mcap')
    robot = load_robot(str(folder / 'robot.urdf'))
    raw, tree = collect(open_recording(folder / 'real.mcap').events(), robot), nominal_tree(robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    comparison = compare_models(equations, lambda _share: None)
    return equations, comparison, decide(equations, comparison)


@pytest.fixture(scope='module')
def rope(tmp_path_factory):
    points = {n: {'value': x, 'unit': 'm'} for n, x in ROPE.items()}
    (law,), problems = stated('distance', **points, a={'value': 6.0, 'unit': 'N'},
                              b={'value': -12.0, 'unit': 'N/m'})  # fmt: skip
    assert not problems
    friction = ['viscous_friction:joint=j1,b=0.1', 'coulomb_friction:joint=j0,level=0.1']
    return recorded(tmp_path_factory.mktemp('rope'), [law, *friction])


@pytest.fixture(scope='module')
def models(rope):
    """Models with a law of the tool of that arm."""
    equations, comparison, decision = rope
    scale = Scale.of(equations, comparison).of_forms()
    return tool_models(Columns(equations), scale, decision)


@pytest.fixture
def searched(models, monkeypatch):
    monkeypatch.setattr(at_tool, 'tool_models', lambda *_: models)


@pytest.mark.usefixtures('searched')
def test_a_rope_to_a_point_is_found(rope):
    """Its tension, where it is tied to the link, and the point of the world."""
    equations, comparison, decision = rope
    found, decided = with_tool_law(equations, comparison, decision)
    law = tool_law_of(decided.model)
    assert decided.verdict == 'missing_physics'
    assert law.effect.formula == 'F_distance[tool] = a + b*s'
    numbers = law.report(equations.motion)
    assert numbers == pytest.approx({**ROPE, 'a': 6.0, 'b': -12.0}, abs=0.15)
    assert len(found.more) == len(comparison.more) + 1
    (remark,) = tool_remarks(decided)
    assert 'a rope or spring from the tool to a point of the world' in remark


@pytest.mark.usefixtures('searched')
def test_a_rope_that_other_forces_fit_as_well_is_refused(rope, monkeypatch):
    """The joint it acts on most is unexplained then, and the formula stands among the rivals."""
    equations, comparison, decision = rope
    monkeypatch.setattr(at_tool, 'LEAST_LAW', 1.1)
    same, decided = with_tool_law(equations, comparison, decision)
    assert same is comparison
    assert decided.unknown
    assert tool_law_of(decided.model) is None
    assert tool_law_of(decided.rivals[0]) is not None
    assert 'fit this motion as well' in decided.refusals[decided.rivals[0].key]
    assert tool_remarks(decided) == ()


def test_friction_alone_asks_for_no_law_of_the_tool(tmp_path):
    equations, comparison, decision = recorded(tmp_path, ['viscous_friction:joint=j1,b=0.3'])
    columns = Columns(equations)
    assert [s.effect for s in decision.model.effects] == [VISCOUS_FRICTION]
    assert not is_asked(columns, decision)
    assert with_tool_law(equations, comparison, decision) == (comparison, decision)
    assert is_asked(columns, replace(decision, unknown=(1,)))


def test_a_robot_without_one_outermost_link_is_not_asked(rope):
    equations, _, decision = rope
    columns = Columns(equations)
    assert is_asked(columns, decision)
    motion = replace(equations.motion, tree=replace(equations.motion.tree, frames=()))
    assert motion.tool is not None  # the only outermost link carries it
    np.testing.assert_allclose(tool_point(motion.tree), equations.motion.tree.parameters[2, 1:4]
                               / equations.motion.tree.parameters[2, 0])  # fmt: skip
