"""What the blocks `ros2_control` of a URDF say of its joints: which are driven, which follow.

Source: documentation of ros2_control, hardware components and mimic joints.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET


def commanded_joints(root: ET.Element) -> frozenset[str] | None:
    """Return the joints with an effort interface; where none has one, those with any."""
    interfaces = [
        (joint.get('name', ''), interface.get('name', ''))
        for block in root.iter('ros2_control')
        for joint in block.iter('joint')
        for interface in joint.iter('command_interface')
    ]
    effort = frozenset(joint for joint, interface in interfaces if interface == 'effort')
    return effort or frozenset(joint for joint, _ in interfaces) or None


def mimic_parameters(root: ET.Element) -> dict[str, ET.Element]:
    """Return by joint what its parameters in `ros2_control` say, as a `<mimic>` would.

    These are `mimic`, the joint that is followed, `multiplier` and `offset`.
    """
    found = {}
    for block in root.iter('ros2_control'):
        for joint in block.iter('joint'):
            said: dict[str, str] = {
                p.get('name', ''): (p.text or '').strip() for p in joint.findall('param')
            }
            if 'mimic' in said:
                mimic = ET.Element('mimic', {'joint': said['mimic']})
                for key in {'multiplier', 'offset'} & set(said):
                    mimic.set(key, said[key])
                found[joint.get('name', '')] = mimic
    return found
