"""A robot as SDF of Gazebo, from its URDF: every link and joint with its own numbers."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.robots.exports.handover import Handover

HELD = ('damping', 'friction', 'stiffness', 'kp', 'kd')
_SERVO = ('gz-sim-joint-position-controller-system', 'gz::sim::systems::JointPositionController')
_ENTRIES = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')


def write_sdf(handed: Handover) -> tuple[str, list[str]]:
    """Return the text of an SDF file, and what it cannot say."""
    urdf = parse_urdf(handed.urdf)
    plain = ET.fromstring(urdf.plain)  # noqa: S314  # written by `rigid`
    root = ET.Element('sdf', version='1.11')
    model = ET.SubElement(root, 'model', name=handed.nominal.robot.name)
    carriers = {x.find('child').get('link', ''): x for x in plain.findall('joint')}  # type: ignore[union-attr]  # written by `rigid`
    for link in plain.findall('link'):
        name = link.get('name', '')
        copy = ET.SubElement(model, 'link', name=name)
        joint = carriers.get(name)
        if joint is not None:  # the frame of a link is that of the joint that carries it
            ET.SubElement(copy, 'pose', relative_to=joint.get('name', '')).text = _zeros()
        _add_inertial(copy, link.find('inertial'))
        if joint is None and name != 'world':
            ground = ET.SubElement(model, 'joint', name=f'{name}_to_world', type='fixed')
            ET.SubElement(ground, 'parent').text = 'world'
            ET.SubElement(ground, 'child').text = name
    for element in plain.findall('joint'):
        _add_joint(model, element, handed)
    for driven, numbers in handed.joints.items():
        if numbers.is_driven and (numbers.kp or numbers.kd):
            plugin = ET.SubElement(model, 'plugin', filename=_SERVO[0], name=_SERVO[1])
            gains = {'joint_name': driven, 'p_gain': repr(numbers.kp), 'i_gain': '0',
                     'd_gain': repr(numbers.kd)}  # fmt: skip
            for tag, text in gains.items():
                ET.SubElement(plugin, tag).text = text
    world = next((x for x in model.findall('link') if x.get('name') == 'world'), None)
    if world is not None:  # the name of the ground
        model.remove(world)
    ET.indent(root)
    return ET.tostring(root, encoding='unicode') + '\n', handed.left_out(HELD)


def _add_joint(model: ET.Element, element: ET.Element, handed: Handover) -> None:
    name = element.get('name', '')
    joint = parse_urdf(handed.urdf).joints[name]
    copy = ET.SubElement(model, 'joint', name=name, type=joint.kind)
    origin = element.find('origin')
    assert origin is not None
    base = {} if joint.parent == 'world' else {'relative_to': joint.parent}
    pose = ET.SubElement(copy, 'pose', base)
    if joint.parent == 'world':
        pose.set('relative_to', '__model__')
    pose.text = f'{origin.get("xyz")} {origin.get("rpy")}'
    ET.SubElement(copy, 'parent').text = joint.parent
    ET.SubElement(copy, 'child').text = joint.child
    if joint.kind == 'fixed':
        return
    axis = ET.SubElement(copy, 'axis')
    ET.SubElement(axis, 'xyz').text = ' '.join(map(repr, joint.axis))
    limit = ET.SubElement(axis, 'limit')
    for tag in ('lower', 'upper', 'effort', 'velocity'):
        if math.isfinite(getattr(joint, tag)):
            ET.SubElement(limit, tag).text = repr(float(getattr(joint, tag)))
    dynamics = ET.SubElement(axis, 'dynamics')
    numbers = {'damping': joint.damping, 'friction': joint.friction}
    known = handed.joints.get(name)
    if known is not None and known.stiffness:
        numbers |= {'spring_stiffness': known.stiffness, 'spring_reference': known.rest}
    for tag, value in numbers.items():
        ET.SubElement(dynamics, tag).text = repr(float(value))
    if joint.follows is not None:
        mimic = ET.SubElement(axis, 'mimic', joint=joint.follows)
        for tag, value in (('multiplier', joint.multiplier), ('offset', joint.offset)):
            ET.SubElement(mimic, tag).text = repr(float(value))
        ET.SubElement(mimic, 'reference').text = '0'


def _add_inertial(link: ET.Element, inertial: ET.Element | None) -> None:
    """Give a link its body; one without has as little as Gazebo accepts."""
    copy = ET.SubElement(link, 'inertial')
    if inertial is None:
        ET.SubElement(copy, 'mass').text = '1e-09'
        tensor = ET.SubElement(copy, 'inertia')
        for key in _ENTRIES:
            ET.SubElement(tensor, key).text = '1e-12' if key[1] == key[2] else '0'
        return
    origin, mass, inertia = (inertial.find(tag) for tag in ('origin', 'mass', 'inertia'))
    assert mass is not None
    assert inertia is not None
    if origin is not None:
        pose = f'{origin.get("xyz", "0 0 0")} {origin.get("rpy", "0 0 0")}'
        ET.SubElement(copy, 'pose').text = pose
    ET.SubElement(copy, 'mass').text = mass.get('value')
    tensor = ET.SubElement(copy, 'inertia')
    for key in _ENTRIES:
        ET.SubElement(tensor, key).text = inertia.get(key, '0')


def _zeros() -> str:
    return '0 0 0 0 0 0'
