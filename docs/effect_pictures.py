"""Pictures of the effects of the catalogue: the force of each along a motion, as SVG.

Nothing is drawn by hand. Each law chooses its numbers as it does for drawn worlds, exerts its force
along the motion of an arm, and is drawn over the variable that the report draws it over.

python docs/effect_pictures.py
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

import numpy as np

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drawing import PilotRun, Scene, UnsuitableError
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Value
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion

TARGET = Path(__file__).parent / 'images' / 'effects'
_JOINT = 1
_STEP, _PERIOD, _PERIODS = 0.005, 2.0, 6
_SEEN, _GROWTH, _ROUNDS = 0.1, 1.3, 12
_WIDTH, _HEIGHT, _LEFT, _BELOW, _EDGE = 360, 200, 52, 40, 10
_ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><mass value="2"/><origin xyz="0 0 -0.2"/>
<inertia ixx="0.03" iyy="0.03" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><mass value="1"/><origin xyz="0 0 -0.15"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool0"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1.3" upper="1.3" effort="40" velocity="9"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
<limit lower="-1.3" upper="1.3" effort="20" velocity="9"/></joint>
<joint name="flange" type="fixed"><parent link="fore"/><child link="tool0"/>
<origin xyz="0 0 -0.3"/></joint>
<ros2_control name="arm" type="system">
<joint name="shoulder"><command_interface name="effort"/></joint>
<joint name="elbow"><command_interface name="effort"/></joint></ros2_control></robot>"""
_LABELS = {
    'position': 'position [rad]', 'velocity': 'velocity [rad/s]', 'effort': 'command [N m]',
    'acceleration': 'acceleration [rad/s²]', 'time': 'time [s]', 'seconds': 'time [s]',
}  # fmt: skip
_STYLE = (
    'text{font:12px system-ui,sans-serif;fill:#333}path{fill:none;stroke-width:1.8;'
    'stroke:#0072b2;stroke-linejoin:round}.axis{stroke:#999;stroke-width:1}'
    '@media(prefers-color-scheme:dark){text{fill:#ddd}path{stroke:#5ab4e6}}'
)


def pictures() -> dict[str, str]:
    """Return an SVG for each effect that exerts a force, by its name."""
    motion = _motion()
    return {name: x for name in EFFECTS if (x := _picture(name, motion))}


def _motion() -> ObservedMotion:
    """Return an arm that swings under commands of the efforts that it needs."""
    tree = read_urdf(_ARM)
    t = _STEP * (0.3 + np.arange(round(_PERIODS * _PERIOD / _STEP)))  # at no row it stands still
    w = 2.0 * np.pi / _PERIOD
    size, phase = np.array([0.5, 1.2]), np.array([1.0, 0.0])
    angle = w * t[:, None] + phase
    q, v, a = size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
    free = ObservedMotion(tree, t, _STEP, q, v, a, np.zeros_like(q), None)
    commands = Drive(t, free.nominal_effort, ((0.0, len(t)),), _STEP)
    effort = np.column_stack([commands.effort(j) for j in range(tree.size)])
    return ObservedMotion(tree, t, _STEP, q, v, a, effort, commands)


def _scene(motion: ObservedMotion, joint: int) -> Scene:
    """Return the arm as a place to draw an effect on."""

    def rms(x: np.ndarray) -> np.ndarray:
        return np.sqrt((x**2).mean(axis=0))

    q = motion.position
    run = PilotRun(
        rms(motion.effort), rms(motion.velocity), rms(motion.acceleration), q.std(axis=0),
        q.min(axis=0), q.max(axis=0), q,
    )  # fmt: skip
    return Scene(np.random.default_rng(3), [_Body(motion, j) for j in range(2)], run, joint)


class _Body:
    """A body of the arm, as drawings of effects see it."""

    is_driven, is_prismatic, kind, limit = True, False, 'revolute', 1.3
    axis, tip = (0.0, 1.0, 0.0), (0.0, 0.0, -0.3)

    def __init__(self, motion: ObservedMotion, j: int) -> None:
        numbers = motion.tree.parameters[j]
        self.joint, self.parent = motion.tree.joint_names[j], j - 1
        self.mass, self.inertia = float(numbers[0]), np.eye(3) * float(numbers[4:].max())


def _picture(name: str, motion: ObservedMotion) -> str:
    """Return the force of an effect over its variable; empty where it exerts none."""
    law = EFFECTS[name]
    if not law.is_force:
        return ''
    try:
        drawn = law.draw(_scene(motion, _JOINT))
    except UnsuitableError:
        return ''
    j = _JOINT if drawn.index is None or drawn.index < 0 else drawn.index
    size, force = drawn.size, np.zeros_like(motion.effort)
    least = _SEEN * np.abs(motion.effort[:, j]).max()
    for _ in range(_ROUNDS):  # of a limit or a stop nothing is seen before it is reached
        force = _force(law, drawn.values(size), drawn.place or motion.tree.joint_names[j], motion)
        if np.abs(force[:, j]).max() > least or size > drawn.largest:
            break
        size *= _GROWTH
    n = round(_PERIOD / _STEP)  # the last period has no future, where filters end
    rows = slice(None) if law.drawn_over == 'time' else slice(-2 * n, -n)
    x = {
        'position': motion.position[:, j], 'velocity': motion.velocity[:, j],
        'effort': motion.effort[:, j], 'acceleration': motion.acceleration[:, j],
        'time': motion.time, 'seconds': motion.time,
    }[law.drawn_over]  # fmt: skip
    y = force[rows, j]
    x = x[rows]
    if law.drawn_over == 'time':
        y = np.abs(y)
    if law.drawn_over == 'seconds':
        x = x - x[0]
    return svg(x, y, _LABELS[law.drawn_over], law.words)


def _force(
    law: Effect, parameters: Mapping[str, Value], place: str, motion: ObservedMotion
) -> np.ndarray:
    """Return the force of an effect with stated parameters, (n, k)."""
    placed = EffectAt.stated(law, place, parameters, motion.tree)
    if not placed.is_complete:  # what is not stated of the play of a gear starts as in a search
        shape = np.where(
            np.isfinite(placed.shape), placed.shape, law.starts(motion, placed.place)[0]
        )
        free = law.columns(motion, placed.place, shape)
        coefficients = np.where(np.isfinite(placed.coefficients), placed.coefficients, 1.0)
        coefficients = coefficients[: free.shape[-1]]
        placed = EffectAt(law, placed.place, shape, coefficients)
    return placed.force(motion)


def svg(x: np.ndarray, y: np.ndarray, label: str, words: str) -> str:
    """Return a curve through points (n,) in their order, with axes, as SVG."""
    low, high = min(float(y.min()), 0.0), max(float(y.max()), 0.0)
    pad = 0.06 * max(high - low, 1e-9)
    ends = (float(x.min()), float(x.max())), (low - pad, high + pad)
    right, bottom = _WIDTH - _EDGE, _HEIGHT - _BELOW
    px = _LEFT + (x - ends[0][0]) / (ends[0][1] - ends[0][0]) * (right - _LEFT)
    py = bottom - (y - ends[1][0]) / (ends[1][1] - ends[1][0]) * (bottom - _EDGE)
    pairs = (f'{a:.1f} {b:.1f}' for a, b in zip(px, py, strict=True))
    points = [pair for pair, _ in groupby(pairs)]
    zero = bottom + ends[1][0] / (ends[1][1] - ends[1][0]) * (bottom - _EDGE)
    texts = [
        _text(_LEFT, bottom + 15, f'{ends[0][0]:.2g}', 'start'),
        _text(right, bottom + 15, f'{ends[0][1]:.2g}', 'end'),
        _text(0.5 * (_LEFT + right), bottom + 32, label, 'middle'),
        _text(_LEFT - 5, zero + 4, '0', 'end'),
        _text(0, 0, 'force [N m]', 'middle').replace(
            'x="0" y="0"', f'transform="translate(12 {0.5 * bottom:.0f}) rotate(-90)"'
        ),
    ]
    texts += [
        _text(_LEFT - 5, py[i] + 4, f'{y[i]:.2g}', 'end')
        for i in {int(y.argmin()), int(y.argmax())} if abs(py[i] - zero) > 12.0
    ]  # fmt: skip
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'width="{_WIDTH}" height="{_HEIGHT}"><title>{words}: force over {label}</title>'
        f'<style>{_STYLE}</style><path class="axis" d="M{_LEFT} {_EDGE}V{bottom}H{right}'
        f'M{_LEFT} {zero:.1f}H{right}"/><path d="M{"L".join(points)}"/>{"".join(texts)}</svg>\n'
    )


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}">{text}</text>'


if __name__ == '__main__':
    TARGET.mkdir(exist_ok=True)
    for old in TARGET.glob('*.svg'):
        old.unlink()
    for stem, picture in pictures().items():
        (TARGET / f'{stem}.svg').write_text(picture, encoding='utf-8')
