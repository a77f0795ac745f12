"""The rival of a diagnosis: `mujoco.sysid`, told beforehand which parameters are unknown.

The recording is cut into windows that start from measured states, as its documentation advises for
motion that is not stable; the residual is that of positions and velocities. It is told that the
friction of one joint is missing, or that the friction of every joint and the masses of all but the
first link are open; a diagnosis is told neither.
"""

from __future__ import annotations

import contextlib
import io
import time
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.reader import open_recording

try:
    import mujoco
    from mujoco import sysid

    IS_INSTALLED = hasattr(sysid, 'optimize')  # without its extra, the module is empty
except ImportError:
    IS_INSTALLED = False

HORIZON_S = 0.3
MOST_WINDOWS = 200
_STEP_S = 0.005
SYSID_KEYS = tuple(
    f'sysid_{name}_{what}' for name in ('one', 'all') for what in ('s', 'off_percent')
)


def sysid_row(robot: Path, recording: Path, joint: str, level: float) -> dict[str, Any]:
    """Return seconds of processor, and how far the level of dry friction is off in per cent.

    For one unknown, and for all of them; null where `mujoco[sysid]` is not installed.

    Args:
        robot: URDF.
        recording: of commands and states at one rate.
        joint: that has the dry friction.
        level: of it [N m].
    """
    found: dict[str, Any] = {}
    for name in ('one', 'all'):
        found |= {f'sysid_{name}_s': None, f'sysid_{name}_off_percent': None}
        if not IS_INSTALLED:
            continue
        sequences, links = _sequences(robot, recording)
        parameters = _parameters(sequences.gt_model, links, (joint,) if name == 'one' else None)
        began = time.process_time()
        residual = sysid.build_residual_fn(models_sequences=[sequences])
        with contextlib.redirect_stdout(io.StringIO()):  # it prints each iteration
            fitted, _ = sysid.optimize(
                initial_params=parameters, residual_fn=residual, optimizer='mujoco', verbose=False
            )
        size = float(fitted[f'{joint} friction'].value[0])
        found[f'sysid_{name}_s'] = time.process_time() - began
        found[f'sysid_{name}_off_percent'] = 100.0 * abs(size - level) / level
    return found


def _sequences(robot: Path, recording: Path) -> tuple[Any, tuple[str, ...]]:
    """Return the windows of a recording with the model of its robot, and its moving links."""
    spec = mujoco.MjSpec.from_string(robot.read_text(encoding='utf-8'))
    spec.option.timestep = _STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    names = [joint.name for joint in spec.joints]
    links = tuple(joint.parent.name for joint in spec.joints)
    for name in names:
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gainprm[0] = 1.0
        for kind in ('JOINTPOS', 'JOINTVEL'):
            spec.add_sensor(
                name=f'{name} {kind}', type=getattr(mujoco.mjtSensor, f'mjSENS_{kind}'),
                objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=name,
            )  # fmt: skip
    model = spec.compile()
    t, q, v, u = _signals(recording, names)
    steps = round(HORIZON_S / _STEP_S)
    starts = np.arange(0, len(t) - steps - 1, steps)
    starts = starts[np.unique(np.linspace(0, len(starts) - 1, MOST_WINDOWS).astype(int))]
    sensed = np.stack([q, v], axis=2).reshape(len(t), -1)  # in the order of the sensors
    windows = [slice(s, s + steps + 1) for s in starts]
    clock = _STEP_S * np.arange(steps + 1)
    return sysid.ModelSequences(
        'robot', spec, [f'window {i}' for i in range(len(windows))],
        [sysid.create_initial_state(model, q[w][0], v[w][0], np.zeros(0)) for w in windows],
        [sysid.TimeSeries(clock, u[w]) for w in windows],
        [sysid.TimeSeries.from_names(clock, sensed[w], model) for w in windows],
    ), links  # fmt: skip


def _signals(
    recording: Path, names: list[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps (n,), positions, velocities and efforts (n, k) of states, on their grid."""
    events = list(open_recording(str(recording)).events(None, None))
    states = [e for e in events if isinstance(e, JointSample)]
    commands = [e for e in events if isinstance(e, CommandSample)]
    order = [states[0].names.index(name) for name in names]
    stamps = np.array([e.stamp_ns for e in states])
    held = np.searchsorted([e.stamp_ns for e in commands], stamps, side='right') - 1
    t = 1e-9 * (stamps - stamps[0])
    q = np.array([e.position for e in states])[:, order]
    v = np.array([e.velocity for e in states])[:, order]
    u = np.array([commands[max(i, 0)].effort for i in held])
    grid = np.arange(t[0], t[-1], _STEP_S)
    q, v, u = (np.stack([np.interp(grid, t, x) for x in y.T], axis=1) for y in (q, v, u))
    return grid, q, v, u


def _parameters(model: Any, links: tuple[str, ...], joints: tuple[str, ...] | None) -> Any:
    """Return the unknowns: friction of some joints, or of all with damping and masses."""
    found = sysid.ParameterDict()
    every = [model.joint(j).name for j in range(model.njnt)]

    def add(name: str, start: float, most: float, change: Any) -> None:
        found.add(
            sysid.Parameter(name, nominal=start, min_value=0.0, max_value=most, modifier=change)
        )

    for name in joints or every:
        add(
            f'{name} friction', 0.1, 50.0,
            lambda s, p, n=name: setattr(s.joint(n), 'frictionloss', float(p.value[0])),
        )  # fmt: skip
    if joints is None:
        for name in every:
            add(
                f'{name} damping', 0.1, 50.0,
                lambda s, p, n=name: s.joint(n).damping.__setitem__(0, float(p.value[0])),
            )  # fmt: skip
        for link in links[1:]:
            mass = float(model.body(link).mass[0])
            add(
                f'{link} mass', mass, 3.0 * mass,
                lambda s, p, n=link: setattr(s.body(n), 'mass', float(p.value[0])),
            )  # fmt: skip
    return found
