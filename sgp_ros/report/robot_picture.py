"""A picture of a robot from its tree, joints and links coloured by a share, as SVG.

Links are straight from joint to joint: the meshes of a URDF are other files, its joints are here.
A circle turns, a square slides.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.rigid_geometry import full_motion
from sgp_ros.rigid.rotations import about
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.robot import Robot

_WIDTH, _HEIGHT, _EDGE, _LABELS = 440.0, 300.0, 24.0, 165.0
_ELEVATION = np.deg2rad(20.0)
_AZIMUTHS = np.deg2rad(np.arange(5.0, 185.0, 15.0))
_LINE = 19.0
"""Height of a label."""
_STUB = 0.15
"""Length that stands for a body without extent, relative to the robot."""
LEVELS = 5
"""Steps of the colour, `share0` to `share4` in `report.css`."""


def robot_picture(
    tree: Tree, posture: np.ndarray, shares: Mapping[str, float],
    what: str = 'share of the mismatch by joint',
) -> str:  # fmt: skip
    """Return the robot in a posture as an `svg` element.

    Args:
        tree: of b bodies.
        posture: (k,) positions of the joints that move on their own [rad or m].
        shares: 0 to 1 by joint, empty for none; a link has the share of the joint that carries it.
        what: the shares are, for those who do not see the picture.
    """
    rotations, origins = link_places(tree, posture)
    body, ends = link_segments(tree, rotations, origins)  # (s,), (s, 2, 3)
    corners, joints = _on_paper(ends, origins[: tree.size])
    share = [shares.get(tree.joint_names[tree.follows[i]], 0.0) for i in range(len(tree.parents))]
    tone = [f'share{min(int(LEVELS * max(x, 0.0)), LEVELS - 1)}' for x in share]
    parts = [
        f'<path class="link {"ground" if i < 0 else tone[i]}" '
        f'd="M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}"/>'
        for i, (a, b) in zip(body, corners, strict=True)
    ]
    for j, (x, y) in enumerate(joints):
        shape = (
            f'rect x="{x - 7:.1f}" y="{y - 7:.1f}" width="14" height="14"'
            if tree.is_prismatic[j]
            else f'circle cx="{x:.1f}" cy="{y:.1f}" r="8"'
        )
        parts.append(f'<{shape} class="joint {tone[j]}"/>')
    said = [
        f'{name} {100.0 * share[j]:.0f} %' if shares else name
        for j, name in enumerate(tree.moving_names)
    ]
    for j, height in enumerate(_heights(joints[:, 1])):
        x, y = joints[j]
        left = _WIDTH - _LABELS
        parts.append(
            f'<path class="leader" d="M{x + 9:.1f} {y:.1f}L{left - 4:.1f} {height:.1f}"/>'
            f'<text x="{left:.1f}" y="{height + 4.5:.1f}">{escape(said[j])}</text>'
        )
    label = f'The robot, {what if shares else "its joints"}: {", ".join(said)}'
    return (
        f'<svg class="robot" viewBox="0 0 {_WIDTH:.0f} {_HEIGHT:.0f}" role="img" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )


def picture_of_robot(
    robot: Robot, positions: Mapping[str, float], shares: Mapping[str, float], what: str = ''
) -> str:
    """Return a robot of any kind as an `svg` element; empty for one without nominal bodies.

    Args:
        robot: whose bodies are drawn.
        positions: of its joints [rad or m].
        shares: 0 to 1 by joint, empty for none.
        what: the shares are.
    """
    from sgp_ros.robots.nominal import nominal_model  # noqa: PLC0415 - loads Pinocchio

    try:
        tree = nominal_model(robot).plain
    except ConfigError:
        return ''
    posture = np.array([positions.get(name, 0.0) for name in tree.moving_names])
    return robot_picture(tree, posture, shares, what)


def link_places(tree: Tree, posture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the axes (b, 3, 3) and origins (b, 3) of all joints in the frame of the root [m]."""
    q = full_motion(tree, posture[None], np.zeros_like(posture)[None], posture[None])[0][0]
    b = len(tree.parents)
    rotations, origins = np.zeros((b, 3, 3)), np.zeros((b, 3))
    for i in tree.outward_order():
        up, axis = int(tree.parents[i]), tree.axes[i]
        carrier, start = (np.eye(3), np.zeros(3)) if up < 0 else (rotations[up], origins[up])
        rotations[i] = carrier @ tree.rotations[i]
        origins[i] = start + carrier @ tree.translations[i]
        if tree.is_prismatic[i]:
            origins[i] += rotations[i] @ axis * q[i]
        else:
            rotations[i] = rotations[i] @ about(axis, q[i])
    return rotations, origins


def link_segments(
    tree: Tree, rotations: np.ndarray, origins: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return bodies (s,), -1 for the root, and the two ends of the lines that draw them (s, 2, 3).

    A body reaches to the joints it carries; the last one to its furthest frame, or to twice its
    centre of mass.
    """
    body, ends = [], []
    reach = max(float(np.ptp(origins, axis=0).max()), 1e-3)
    for i, up in enumerate(tree.parents):
        body.append(int(up))
        ends.append((np.zeros(3) if up < 0 else origins[up], origins[i]))
    for i in set(range(len(tree.parents))) - set(tree.parents.tolist()):
        mass, moment = tree.parameters[i, 0], tree.parameters[i, 1:4]
        tips = [f.translation for f in tree.frames if f.body == i]
        tips.append(2.0 * moment / mass if mass > 0.0 else np.zeros(3))
        tip = max(tips[:-1], key=np.linalg.norm, default=np.zeros(3))
        if np.linalg.norm(tip) < 0.05 * reach:
            tip = tips[-1]
        if np.linalg.norm(tip) < 1e-6:
            tip = _STUB * reach * tree.axes[i]
        body.append(i)
        ends.append((origins[i], origins[i] + rotations[i] @ tip))
    return np.array(body), np.array(ends)


def _on_paper(ends: np.ndarray, origins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return lines (s, 2, 2) and joints (k, 2) as seen from where the lines look longest."""
    views = [_view(azimuth) for azimuth in _AZIMUTHS]
    lengths = [np.linalg.norm((ends[:, 1] - ends[:, 0]) @ view.T, axis=1).sum() for view in views]
    view = views[int(np.argmax(lengths))]
    flat, joints = ends @ view.T, origins @ view.T
    points = np.vstack([flat.reshape(-1, 2), joints])
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    room = np.array([_WIDTH - _LABELS - 3.0 * _EDGE, _HEIGHT - 2.0 * _EDGE])
    scale = float((room / np.maximum(size, 1e-9)).min())
    shift = np.array([1.5 * _EDGE, _EDGE]) + 0.5 * (room - scale * size)

    def place(x: np.ndarray) -> np.ndarray:
        return np.asarray((x - low) * scale + shift)

    return place(flat), place(joints)


def _view(azimuth: float) -> np.ndarray:
    """Return the axes of the paper, right and down, (2, 3); z of the root points up."""
    s, c = np.sin(azimuth), np.cos(azimuth)
    up = np.array([-np.sin(_ELEVATION) * c, -np.sin(_ELEVATION) * s, np.cos(_ELEVATION)])
    return np.array([[-s, c, 0.0], -up])


def _heights(wanted: np.ndarray) -> np.ndarray:
    """Return the heights of the labels: near those wanted (k,), without overlap."""
    order = np.argsort(wanted, kind='stable')
    heights = wanted[order].astype(float)
    for i in range(1, len(heights)):
        heights[i] = max(heights[i], heights[i - 1] + _LINE)
    excess = max(0.0, float(heights[-1]) - (_HEIGHT - 0.5 * _LINE))
    for i in range(len(heights) - 1, -1, -1):
        limit = _HEIGHT - 0.5 * _LINE if i == len(heights) - 1 else heights[i + 1] - _LINE
        heights[i] = min(heights[i], limit) if excess else heights[i]
    placed = np.empty_like(heights)
    placed[order] = heights
    return placed
