"""Recordings as seen through an error of the connection, and how a robot really stands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sgp_proof.concealed.robots import urdf
from sgp_ros.simulation.tree_simulator import tree_simulator


def corrupted(recording, error):
    """Return what is recorded through an error of the connection."""
    kind, p, names = error['effect'], error['parameters'], list(recording.joint_names)
    i = names.index(error['joint']) if error['joint'] in names else None
    if kind in {'joint_sign', 'swapped_joints'}:
        change = lambda x: _changed(x, i, np.negative)  # noqa: E731 - one of two
        if kind == 'swapped_joints':
            j = names.index(p['other_joint'])
            change = lambda x: _exchanged(x, i, j)  # noqa: E731 - the other
        motion = change if p['channels'] != 'effort' else None
        effort = change if p['channels'] != 'position' else None
        return _mapped(recording, motion, motion, effort)
    if kind == 'encoder_offset':
        return _mapped(recording, lambda q: _changed(q, i, lambda x: x + p['offset']))
    if kind == 'position_scale':
        return _mapped(recording, *[lambda q: _changed(q, i, lambda x: x * p['scale'])] * 2)
    if kind == 'effort_scale':
        where = slice(None) if i is None else i
        return _mapped(recording, effort=lambda u: _changed(u, where, lambda x: x * p['scale']))
    if kind == 'clock_offset':
        late = round(p['offset'] * 1e9)
        return replace(recording, command_stamps_ns=recording.command_stamps_ns + late)
    return recording


def _mapped(recording, position=None, velocity=None, effort=None):
    """Return a recording with changed columns of all joints, also of commands and efforts."""
    changed = {}
    if position is not None:
        changed['position'] = position(recording.position.copy())
        changed['true_position'] = position(recording.true_position.copy())
    if velocity is not None:
        changed['true_velocity'] = velocity(recording.true_velocity.copy())
        changed['true_acceleration'] = velocity(recording.true_acceleration.copy())
        if recording.velocity is not None:
            changed['velocity'] = velocity(recording.velocity.copy())
    if effort is not None:
        where = [recording.joint_names.index(j) for j in recording.command_joints]
        whole = np.zeros((len(recording.command), len(recording.joint_names)))
        whole[:, where] = recording.command
        changed['command'] = np.ascontiguousarray(effort(whole)[:, where])
        if recording.effort is not None:
            changed['effort'] = effort(recording.effort.copy())
    return replace(recording, **changed)


def _changed(values, i, change):
    values[:, i] = change(values[:, i])
    return values


def _exchanged(values, i, j):
    values[:, [i, j]] = values[:, [j, i]]
    return values


def standing(world, errors):
    """Return the world as it stands: with a turned base, or links of other lengths."""
    if not errors:
        return world
    wrong = {e['link']: e for e in world.errors}
    given = [_stood(b, errors) for b in world.bodies]
    true = [_with_error(b, wrong[b.link]) if b.link in wrong else b for b in given]
    return replace(
        world, bodies=given, nominal=tree_simulator(urdf(world.family, given)),
        true=tree_simulator(urdf(world.family, true)),
    )  # fmt: skip


def _stood(body, errors):
    for e in errors:
        p = e['parameters']
        if e['effect'] == 'joint_origin' and body.joint == e['joint']:
            body = replace(body, xyz=tuple(np.add(body.xyz, [p['x'], p['y'], p['z']])))
        if e['effect'] == 'base_orientation' and body.parent < 0:
            R = _turn(p['roll'], p['pitch'], 0.0)
            body = replace(
                body, xyz=tuple(R @ np.array(body.xyz)), rpy=_angles(R @ _turn(*body.rpy))
            )
    return body


def _with_error(body, error):
    return replace(
        body, mass=body.mass * error['mass'], com=body.com + np.array(error['com']),
        inertia=error['inertia'] * body.inertia,
    )  # fmt: skip


def _turn(roll, pitch, yaw):
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x


def _angles(R):
    return (
        math.atan2(R[2, 1], R[2, 2]), math.asin(max(-1.0, min(1.0, -R[2, 0]))),
        math.atan2(R[1, 0], R[0, 0]),
    )  # fmt: skip
