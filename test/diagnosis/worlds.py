"""Hanging chains of one or two links written out by hand, integrated here, recorded as events.

The equations are those of textbooks, not of `sgp_ros`: a link of mass m, centre at c, inertia I
about it, length l, on a horizontal axis; both joints measured from the link before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.apps.simulation import write_simulated
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate as simulated
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree_simulator import tree_simulator

GRAVITY = 9.81
PERIOD = 0.005
"""Commands and states come this often [s]."""
START_NS = 1_700_000_000_000_000_000
QUANTUM = 2.0 * math.pi / 2**17
FINE = 0.001


@dataclass(frozen=True)
class Link:
    mass: float
    centre: float
    inertia: float
    length: float
    damping: float


CHAINS = {
    1: (Link(1.2, 0.25, 0.02, 0.5, 0.1),),
    2: (Link(1.5, 0.2, 0.03, 0.4, 0.15), Link(0.8, 0.15, 0.01, 0.3, 0.08)),
}
"""Nominal chains."""


@dataclass(frozen=True)
class World:
    """True history of a world, at the times of the states."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    command: np.ndarray
    """(n, k), each holds for one period."""


def acceleration(chain, q, v, tau):
    """Return the accelerations of one or two links under efforts tau, as a tuple of floats."""
    one = chain[0]
    if len(chain) == 1:
        inertia = one.inertia + one.mass * one.centre**2
        weight = one.mass * GRAVITY * one.centre * math.sin(q[0])
        return ((tau[0] - weight - one.damping * v[0]) / inertia,)
    two = chain[1]
    c, s = math.cos(q[1]), math.sin(q[1])
    arm = two.mass * one.length * two.centre
    m22 = two.inertia + two.mass * two.centre**2
    m12 = m22 + arm * c
    m11 = one.inertia + one.mass * one.centre**2 + two.mass * one.length**2 + m22 + 2.0 * arm * c
    low = two.mass * two.centre * GRAVITY * math.sin(q[0] + q[1])
    high = (one.mass * one.centre + two.mass * one.length) * GRAVITY * math.sin(q[0])
    r1 = tau[0] - one.damping * v[0] - high - low + arm * s * (2.0 * v[0] * v[1] + v[1] ** 2)
    r2 = tau[1] - two.damping * v[1] - low - arm * s * v[0] ** 2
    det = m11 * m22 - m12**2
    return (m22 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det


def _none(t, q, v):
    return (0.0, 0.0)


def _reference(seed, k, reach):
    rng = np.random.default_rng(seed)
    size = reach * rng.uniform(0.4, 1.0, (k, 4)) / 4.0
    omega = 2.0 * math.pi * rng.uniform(0.15, 1.4, (k, 4))
    phase = rng.uniform(0.0, 2.0 * math.pi, (k, 4))

    def at(t):
        angle = omega * t + phase
        return (size * np.sin(angle)).sum(axis=1), (size * omega * np.cos(angle)).sum(axis=1)

    return at


def simulate(chain, seed, seconds=12.0, *, force=_none, motor=None, dry=None, held=(), reach=2.5):
    """Integrate a chain that follows a sum of sines.

    Args:
        chain: the true links.
        seed: of the reference.
        seconds: duration.
        force: of (t, q, v), added to the motors' efforts.
        motor: of (commands so far, fine time), the efforts that arrive; None for the last command.
        dry: of (t, q, s), size of the dry friction of joint 0 moving in the direction s.
        held: joints of which the reference stays at 0.
        reach: of the reference [rad].
    """
    k, n = len(chain), round(seconds / PERIOD)
    wanted = _reference(seed, k, reach)
    free = np.array([j not in held for j in range(k)])
    stiff, damp = np.array([18.0, 8.0])[:k], np.array([3.0, 1.2])[:k]
    q, v = tuple(wanted(0.0)[0] * free), tuple(wanted(0.0)[1] * free)
    fine = round(PERIOD / FINE)
    kept, commands = [], []
    for i in range(n):
        t = i * PERIOD
        goal, rate = wanted(t)
        u = stiff * (goal * free - q) + damp * (rate * free - v)
        commands.append(tuple(u))
        effort = commands[-1] if motor is None else motor(commands, t)
        kept.append((q, v, _acceleration(chain, t, q, v, effort, force, dry)))
        for j in range(fine):
            now = t + j * FINE
            if motor is not None:
                effort = motor(commands, now)
            q, v = _advance(chain, now, q, v, effort, force, dry)
    at, speed, rise = (np.array(x) for x in zip(*kept, strict=True))
    return World(PERIOD * np.arange(n), at, speed, rise, np.array(commands))


def _acceleration(chain, t, q, v, effort, force, dry, s=None):
    extra = force(t, q, v)
    tau = [u + x for u, x in zip(effort, extra, strict=False)]
    if dry is not None:
        if s is None:
            s = math.copysign(1.0, v[0]) if v[0] else _way(chain, t, q, v, tau, dry)
            if not s:
                return (0.0,)
        tau[0] -= s * dry(t, q, s)
    return acceleration(chain, q, v, tau)


def _way(chain, t, q, v, tau, dry):
    """Return where a joint at rest starts to, 0 where friction holds it."""
    pull = acceleration(chain, q, v, tau)[0]
    inertia = 1.0 / (acceleration(chain, q, v, (1.0,))[0] - acceleration(chain, q, v, (0.0,))[0])
    s = math.copysign(1.0, pull)
    return s if abs(pull) * inertia > dry(t, q, s) else 0.0


def _advance(chain, t, q, v, effort, force, dry, h=FINE):
    if dry is None:
        return _runge_kutta(chain, t, q, v, effort, force, None, None, h)
    s = math.copysign(1.0, v[0])
    if not v[0]:
        tau = [u + x for u, x in zip(effort, force(t, q, v), strict=False)]
        s = _way(chain, t, q, v, tau, dry)
        if not s:
            return q, v
    after, speed = _runge_kutta(chain, t, q, v, effort, force, dry, s, h)
    if not v[0] or speed[0] * s > 0.0:
        return after, speed
    part = h * v[0] / (v[0] - speed[0])
    at, _ = _runge_kutta(chain, t, q, v, effort, force, dry, s, part)
    return _advance(chain, t + part, at, (0.0,), effort, force, dry, h - part)


def _runge_kutta(chain, t, q, v, effort, force, dry, s, h):
    def slope(dt, p, w):
        return _acceleration(chain, t + dt, p, w, effort, force, dry, s)

    def ahead(x, dx, dt):
        return tuple(a + dt * b for a, b in zip(x, dx, strict=True))

    a1 = slope(0.0, q, v)
    v2 = ahead(v, a1, h / 2)
    a2 = slope(h / 2, ahead(q, v, h / 2), v2)
    v3 = ahead(v, a2, h / 2)
    a3 = slope(h / 2, ahead(q, v2, h / 2), v3)
    v4 = ahead(v, a3, h)
    a4 = slope(h, ahead(q, v3, h), v4)

    def mean(x1, x2, x3, x4):
        return tuple(
            (a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(x1, x2, x3, x4, strict=True)
        )

    return ahead(q, mean(v, v2, v3, v4), h), ahead(v, mean(a1, a2, a3, a4), h)


def delayed(delay):
    """Return a motor that obeys late, as `simulate` asks for; a multiple of the fine step."""

    def motor(commands, t):
        i = math.floor((t - delay) / PERIOD + 1e-6)
        return commands[max(i, 0)]

    return motor


def shown(position, quantum=QUANTUM):
    """Return what an encoder shows."""
    return np.round(position / quantum) * quantum if quantum else position


def events_of(world, *, quantum=QUANTUM, velocity=None, effort=None, commands=True):
    """Return the recording of a world: states, and commands that begin with them."""
    k = world.position.shape[1]
    names = tuple(f'joint{j}' for j in range(k))
    found = []
    for i, q in enumerate(shown(world.position, quantum)):
        stamp = START_NS + round(world.time[i] * 1e9)
        if commands:
            found.append(CommandSample(stamp, frozen_array(world.command[i])))
        found.append(JointSample(
            stamp, names, frozen_array(q),
            None if velocity is None else frozen_array(velocity[i]),
            None if effort is None else frozen_array(effort[i]),
        ))  # fmt: skip
    return found


def urdf(chain, kind='continuous', passive=()):
    """Return the URDF of a chain whose links hang down."""
    parts = ['<robot name="chain">', '<link name="base"/>']
    parent, below = 'base', 0.0
    for j, link in enumerate(chain):
        i = f'{link.inertia!r}'
        parts.append(
            f'<link name="link{j}"><inertial><origin xyz="0 0 {-link.centre!r}"/>'
            f'<mass value="{link.mass!r}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" '
            'ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{j}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="link{j}"/><origin xyz="0 0 {below!r}"/><axis xyz="0 1 0"/>'
            '<limit lower="-2.5" upper="2.5" effort="100" velocity="50"/>'
            f'<dynamics damping="{link.damping!r}"/></joint>'
        )
        parent, below = f'link{j}', -link.length
    parts.append(
        '<link name="tool0"/><joint name="tool" type="fixed">'
        f'<parent link="{parent}"/><child link="tool0"/>'
        f'<origin xyz="0 0 {below!r}"/></joint><ros2_control name="x" type="system">'
    )
    parts += [
        f'<joint name="joint{j}"><command_interface name="effort"/></joint>'
        for j in range(len(chain)) if j not in passive
    ]  # fmt: skip
    return '\n'.join([*parts, '</ros2_control></robot>'])


def robot_of(folder, chain, **options):
    """Return robot and nominal tree of a chain."""
    path = folder / 'chain.urdf'
    path.write_text(urdf(chain, **options))
    robot = load_robot(str(path))
    return robot, nominal_tree(robot)


def heavier(chain, body, factor):
    """Return the chain with one mass and inertia scaled."""
    links = list(chain)
    links[body] = replace(
        links[body], mass=factor * links[body].mass, inertia=factor * links[body].inertia
    )
    return tuple(links)


def recorded(folder, text, effects, *, seconds=20.0, rate_hz=200.0):
    """Return trajectory and nominal tree of a simulated robot that measures its effort."""
    path = folder / 'robot.urdf'
    path.write_text(text)
    simulation = make_simulation(
        tree_simulator(text), effects=effects, seed=5, rate_hz=rate_hz,
        sensors=Sensors(measures_velocity=True, measures_effort=True),
    )  # fmt: skip
    write_simulated(simulated(simulation, seconds), folder / 'robot.mcap')
    robot = load_robot(str(path))
    return collect(open_recording(folder / 'robot.mcap').events(), robot), nominal_tree(robot)
