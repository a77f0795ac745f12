"""Kinematic trees of URDFs: order, frames, locked and following joints, and refusals."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import Payload, read_urdf
from test.rigid.random_urdf import random_urdf

ARM = """
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.5"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.01"/></inertial></link>
  <link name="fore"><inertial><mass value="1"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/fore.dae"/></geometry></visual></link>
  <link name="tool"><inertial><mass value="0.5"/></inertial></link>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0 0 1"/><axis xyz="0 2 0"/><dynamics damping="0.3" friction="0.2"/></joint>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="2" effort="30" velocity="4"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/>
    <origin xyz="0 0 0.2"/></joint>
  %s
</robot>
"""
FINGER = """
<link name="left"/><link name="right"/>
<joint name="grip" type="prismatic"><parent link="tool"/><child link="left"/>
  <limit lower="0" upper="0.04"/></joint>
<joint name="other" type="prismatic"><parent link="tool"/><child link="right"/>
  <mimic joint="grip" multiplier="-2" offset="0.01"/></joint>
"""


def _control(*interfaces):
    joints = ''.join(
        f'<joint name="{name}"><command_interface name="{interface}"/></joint>'
        for name, interface in interfaces
    )
    return ARM % f'<ros2_control name="c" type="system">{joints}</ros2_control>'


def test_numbers_of_the_file_arrive():
    """Limits, friction and names; absent limits are infinite; axes have length one."""
    tree = read_urdf(ARM % '')
    assert sorted(tree.joint_names) == ['elbow', 'shoulder']
    i, j = (tree.joint_names.index(name) for name in ('shoulder', 'elbow'))
    assert tree.link_names[i] == 'upper'
    assert (tree.parents[i], tree.parents[j]) == (-1, i)
    assert (tree.lower[i], tree.upper[i]) == (-1.0, 2.0)
    assert (tree.effort_limit[i], tree.velocity_limit[i]) == (30.0, 4.0)
    assert (tree.lower[j], tree.upper[j], tree.effort_limit[j]) == (-np.inf, np.inf, np.inf)
    assert (tree.damping[j], tree.friction[j]) == (0.3, 0.2)
    np.testing.assert_array_equal(tree.axes[j], [0.0, 1.0, 0.0])


def test_links_fixed_to_one_another_are_one_body():
    """The tool adds its mass and first moment to the fore-arm, and keeps its frame."""
    tree = read_urdf(ARM % '')
    j = tree.joint_names.index('elbow')
    np.testing.assert_allclose(tree.parameters[j, :4], [1.5, 0.0, 0.0, 0.1])
    tool = next(frame for frame in tree.frames if frame.name == 'tool')
    assert tool.body == j
    np.testing.assert_allclose(tool.translation, [0.0, 0.0, 0.2])


def test_a_file_reads_like_its_text(tmp_path):
    """A path, as text or as `Path`, or the XML itself."""
    path = tmp_path / 'arm.urdf'
    path.write_text('<?xml version="1.0"?>' + ARM % '')
    for source in (path, str(path), ARM % ''):
        assert read_urdf(source).name == 'arm'


def test_joints_may_have_the_names_of_links():
    """Those of a MuJoCo model often have; what is locked, and what hangs on it, is the same."""
    text = random_urdf(3, 4)
    tree = read_urdf(text, locked={'j1': 0.3})
    same = read_urdf(text.replace('link_j', 'j'), locked={'j1': 0.3})
    assert same.joint_names == tree.joint_names
    assert set(same.joint_names) <= set(same.link_names)
    np.testing.assert_array_equal(same.parameters, tree.parameters)
    np.testing.assert_array_equal(same.translations, tree.translations)


def test_loads_are_on_outermost_links_in_any_order_of_the_joints():
    """A link with `tool0` carries them; without, each one that no other hangs on."""
    plain = ARM % ''
    assert read_urdf(plain).joint_names == ('elbow', 'shoulder')
    assert read_urdf(plain).outermost == (0,)
    assert read_urdf(plain, joints=['shoulder', 'elbow']).outermost == (1,)
    gripper = ARM % FINGER
    assert read_urdf(gripper).moving_names == ('elbow', 'shoulder', 'grip')
    assert read_urdf(gripper).outermost == (2,)
    assert read_urdf(gripper.replace('"tool"', '"tool0"')).outermost == (0,)
    hand = gripper.replace('<parent link="tool"/><child link="left"/>',
                           '<parent link="upper"/><child link="left"/>')  # fmt: skip
    assert read_urdf(hand).outermost == (0, 2)


def test_joints_come_in_the_order_asked_for():
    """Torques are permuted, not changed."""
    text = random_urdf(4, 6)
    names = [f'j{i}' for i in range(6)]
    order = [3, 0, 5, 1, 4, 2]
    one, other = (read_urdf(text, joints=x) for x in (names, [names[i] for i in order]))
    q, v, a = np.random.default_rng(0).normal(size=(3, 4, 6))
    tau = inverse_dynamics(one, one.parameters, q, v, a)
    permuted = inverse_dynamics(other, other.parameters, q[:, order], v[:, order], a[:, order])
    np.testing.assert_allclose(permuted, tau[:, order], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize('seed', range(6))
def test_a_locked_joint_is_one_that_rests_there(seed):
    """Torques on the others are those of the whole tree with that joint held."""
    text = random_urdf(seed, 6)
    names = [f'j{i}' for i in range(6)]
    locked = {'j1': 0.4, 'j4': -0.7}
    whole, part = read_urdf(text, joints=names), read_urdf(text, locked=locked)
    moving = [names.index(name) for name in part.joint_names]
    q, v, a = np.random.default_rng(seed).normal(size=(3, 4, 6))
    q[:, [1, 4]], v[:, [1, 4]], a[:, [1, 4]] = (0.4, -0.7), 0.0, 0.0
    expected = inverse_dynamics(whole, whole.parameters, q, v, a)[:, moving]
    found = inverse_dynamics(part, part.parameters, q[:, moving], v[:, moving], a[:, moving])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_a_follower_adds_no_joint_but_its_inertia():
    """It moves by multiplier and offset, and is locked with its leader."""
    tree = read_urdf(ARM % FINGER)
    assert tree.size == 3
    assert tree.joint_names[3] == 'other'
    assert tree.follows[3] == tree.joint_names.index('grip')
    assert (tree.multipliers[3], tree.offsets[3]) == (-2.0, 0.01)
    resting = read_urdf(ARM % FINGER, joints=['shoulder', 'elbow'], locked={'grip': 0.03})
    right = next(frame for frame in resting.frames if frame.name == 'right')
    np.testing.assert_allclose(right.translation, [0.01 - 2 * 0.03, 0.0, 0.2])


def test_parameters_of_ros2_control_make_a_joint_follow_as_a_mimic_does():
    """Some files leave `<mimic>` out and say it there; a multiplier is 1 where none is stated."""
    free = FINGER.replace('<mimic joint="grip" multiplier="-2" offset="0.01"/>', '')

    def controlled(text, *parameters):
        lines = ''.join(f'<param name="{name}">{value}</param>' for name, value in parameters)
        return text + (
            f'<ros2_control name="c" type="system"><joint name="other">{lines}</joint>'
            '<joint name="grip"><command_interface name="effort"/></joint></ros2_control>'
        )

    said = (('mimic', 'grip'), ('multiplier', '-2'), ('offset', ' 0.01 '))
    tree, plain = read_urdf(ARM % controlled(free, *said)), read_urdf(ARM % FINGER)
    assert tree.moving_names == plain.moving_names
    np.testing.assert_array_equal(tree.follows, plain.follows)
    np.testing.assert_array_equal(tree.multipliers, plain.multipliers)
    np.testing.assert_array_equal(tree.offsets, plain.offsets)
    assert read_urdf(ARM % controlled(free, said[0])).multipliers[3] == 1.0
    both = read_urdf(ARM % controlled(FINGER, ('mimic', 'grip'), ('multiplier', '7')))
    assert both.multipliers[3] == -2.0
    with pytest.raises(ConfigError, match="mimics 'thumb'"):
        read_urdf(ARM % controlled(free, ('mimic', 'thumb')))


def test_chains_of_followers_lead_to_the_joint_that_moves_on_its_own():
    """Multipliers multiply, offsets add up."""
    third = FINGER + (
        '<link name="tip"/><joint name="third" type="revolute"><parent link="left"/>'
        '<child link="tip"/><mimic joint="other" multiplier="3" offset="1"/></joint>'
    )
    tree = read_urdf(ARM % third)
    i = tree.joint_names.index('third')
    assert tree.joint_names[tree.follows[i]] == 'grip'
    assert tree.multipliers[i] == -6.0
    assert tree.offsets[i] == pytest.approx(1.0 + 3 * 0.01)


@pytest.mark.parametrize(
    ('text', 'passive', 'actuated'),
    [
        (ARM % '', None, {'shoulder', 'elbow'}),
        (_control(('elbow', 'effort')), None, {'elbow'}),
        (_control(('elbow', 'effort'), ('shoulder', 'position')), None, {'elbow'}),
        (_control(('shoulder', 'position')), None, {'shoulder'}),
        (_control(), None, {'shoulder', 'elbow'}),
        (_control(('elbow', 'effort')), ['elbow'], {'shoulder'}),
        (_control(('elbow', 'effort')), [], {'shoulder', 'elbow'}),
    ],
)
def test_effort_interfaces_say_which_joints_are_driven(text, passive, actuated):
    """A list of passive joints overrules the file."""
    tree = read_urdf(text, passive=passive)
    assert {n for n, x in zip(tree.joint_names, tree.is_actuated, strict=True) if x} == actuated


def test_a_payload_is_a_part_of_the_body_that_carries_it():
    """As Pinocchio adds it at the frame of the link."""
    load = Payload('tool', 0.7, (0.1, 0.2, 0.3), (0.01, 0.002, 0.03, 0.001, 0.004, 0.02))
    bare, loaded = read_urdf(ARM % ''), read_urdf(ARM % '', payload=load)
    model = pinocchio.buildModelFromXML(ARM % '')
    frame = model.frames[model.getFrameId('tool')]
    tensor = np.array([[0.01, 0.002, 0.001], [0.002, 0.03, 0.004], [0.001, 0.004, 0.02]])
    moved = frame.placement.act(pinocchio.Inertia(0.7, np.array(load.com), tensor))
    j = bare.joint_names.index('elbow')
    difference = loaded.parameters - bare.parameters
    np.testing.assert_allclose(difference[j], moved.toDynamicParameters(), atol=1e-14)
    assert not np.any(np.delete(difference, j, axis=0))


def test_arrays_of_a_tree_are_read_only():
    """A value object does not change under its users."""
    with pytest.raises(ValueError, match='read-only'):
        read_urdf(ARM % '').parameters[0, 0] = 1.0


@pytest.mark.parametrize(
    ('text', 'found'),
    [
        ('<robot', 'not XML'),
        ('<sdf/>', '<sdf>'),
        ('<!DOCTYPE r [<!ENTITY x "y">]><robot>&x;</robot>', 'document type'),
        ('<robot name="r"/>', '0 links'),
        ('<robot name="r"><link name="a"/></robot>', 'no joint that moves'),
        (ARM % '<link name="loose"/>', "['base', 'loose']"),
        (ARM % '<link name="base"/>', "several links are named ['base']"),
        ((ARM % '').replace('0 2 0', '0 0 0'), 'joint elbow has the axis'),
        ((ARM % '').replace('0 2 0', '0 up 0'), "joint elbow: xyz is 'up'"),
        ((ARM % '').replace('"0 2 0"', '"0 2"'), 'three numbers'),
        ((ARM % '').replace('continuous', 'floating'), "joint elbow of type 'floating'"),
        ((ARM % '').replace('continuous', 'planar'), "joint elbow of type 'planar'"),
        ((ARM % '').replace('"fore"/>', '"four"/>'), "joint elbow names the links ['four']"),
        ((ARM % '').replace('value="2"', 'value="-2"'), 'link upper has the mass -2.0'),
        ((ARM % '').replace('value="2"', 'value="nan"'), "link upper: value is 'nan'"),
        ((ARM % '').replace('<mass value="2"/>', ''), 'link upper states no value'),
        ((ARM % '').replace('effort="30"', 'effort="much"'), "effort is 'much'"),
        ((ARM % '').replace('<joint name="elbow"', '<joint'), '<joint> without a name'),
        (ARM % FINGER.replace('joint="grip"', 'joint="hand"'), "mimics 'hand'"),
        (ARM % FINGER.replace('joint="grip"', 'joint="other"'), "mimics 'other'"),
        (ARM % FINGER.replace('joint="grip"', 'joint="flange"'), "mimics 'flange'"),
        (ARM % FINGER.replace('child link="right"', 'child link="left"'),
         'link left is the child of several joints'),
    ],
)  # fmt: skip
def test_what_is_no_tree_is_refused_in_one_line(text, found):
    """The line names the joint or link."""
    with pytest.raises(ConfigError) as caught:
        read_urdf(text)
    assert found in str(caught.value)
    assert '\n' not in str(caught.value)


def test_links_in_a_loop_are_refused():
    """Each has a parent, but none of them hangs on the root."""
    loop = ''.join(
        f'<link name="l{i}"/><joint name="k{i}" type="fixed"><parent link="l{1 - i}"/>'
        f'<child link="l{i}"/></joint>'
        for i in range(2)
    )
    with pytest.raises(ConfigError, match='form a loop'):
        read_urdf(ARM % loop)


@pytest.mark.parametrize(
    ('arguments', 'found'),
    [
        ({'joints': ['knee']}, "joints ['knee']"),
        ({'joints': ['other']}, "joints ['other']"),
        ({'joints': ['flange']}, "joints ['flange']"),
        ({'joints': ['elbow', 'elbow']}, 'repeats a name'),
        ({'joints': []}, 'all joints are locked'),
        ({'locked': {'knee': 0.0}}, "locked ['knee']"),
        ({'locked': {'elbow': np.nan}}, "{'elbow': nan}"),
        ({'joints': ['elbow'], 'locked': {'elbow': 0.0}}, 'in both joints and locked'),
        ({'passive': ['knee']}, "passive ['knee']"),
        ({'payload': Payload('hand', 1.0)}, "link 'hand'"),
        ({'payload': Payload('base', 1.0)}, "link 'base'"),
    ],
)
def test_names_that_do_not_fit_are_refused(arguments, found):
    """The error lists the names there are."""
    with pytest.raises(ConfigError) as caught:
        read_urdf(ARM % FINGER, **arguments)
    assert found in str(caught.value)


def test_a_missing_or_unreadable_file_is_refused(tmp_path):
    """Not XML is one thing, not text another."""
    with pytest.raises(ConfigError, match='no file'):
        read_urdf(tmp_path / 'none.urdf')
    (tmp_path / 'bytes.urdf').write_bytes(b'\xff\xfe<robot/>')
    with pytest.raises(ConfigError, match='UTF-8'):
        read_urdf(tmp_path / 'bytes.urdf')
