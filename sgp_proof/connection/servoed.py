"""Worlds of position control: robots that follow smooth targets under gains, with what is hidden.

The truth moves in MuJoCo, whose friction and integration share no code with the package. The
drives are MuJoCo's own, so that they act within the stages of the Runge-Kutta method: computed
once a step, they would act half a step late, which with stiff gains is a sixth of a rotor.
What makes less than counts as physics is drawn again.
"""

from __future__ import annotations

import json
import math

import mujoco
import numpy as np
import yaml

from sgp_proof.concealed import robots
from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.physics.catalogue import ARMATURE, COMMAND_DELAY, COULOMB_FRICTION
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.exports.handover import hand_over
from sgp_ros.robots.exports.mjcf import write_mjcf
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

GAIN, DELAY, ROTOR, DRY = 'gain_scale', COMMAND_DELAY.name, ARMATURE.name, COULOMB_FRICTION.name
PLAN = (
    (GAIN,), (DELAY,), (ROTOR,), (DRY,), (DELAY, ROTOR), (DELAY, DRY), (ROTOR, DRY), (GAIN, DRY),
    (), (DELAY, GAIN), (DRY, DRY), (),
)  # fmt: skip
_FAMILIES = ('arm2', 'arm3', 'scara', 'pendulum', 'axis')
_STEP_S, _LENGTH_S, _STAMP_NS = 2.5e-4, 24.0, 1_700_000_000_000_000_000
_RATES_HZ = (50.0, 100.0, 125.0, 200.0, 250.0, 500.0)


def draw_case(seed, case):
    """Write recording, robot, gains and answer of a world."""
    rng = np.random.default_rng([seed, ord('C')])
    kinds = PLAN[seed % len(PLAN)]
    least = 2 if ROTOR in kinds or kinds == (DRY, DRY) else 1
    while True:
        family, bodies = robots.draw_robot(rng)
        if family in _FAMILIES and all(b.is_driven for b in bodies) and len(bodies) >= least:
            break
    case.mkdir(parents=True, exist_ok=True)
    (case / 'robot.urdf').write_text(robots.urdf(family, bodies), encoding='utf-8')
    model = _model(case / 'robot.urdf')
    names = [b.joint for b in bodies]
    inertia, gravity = _typical(model, bodies)
    frequency, ratio = rng.uniform(3.0, 9.0, len(names)), rng.uniform(0.5, 1.1, len(names))
    kp = inertia * (2.0 * np.pi * frequency) ** 2
    kd = 2.0 * ratio * np.sqrt(kp * inertia)
    kp, kd = (np.array([float(f'{x:.3g}') for x in gains]) for gains in (kp, kd))
    rate = float(rng.choice(_RATES_HZ))
    targets = _targets(rng, bodies, rate)
    effort = inertia * np.abs(np.gradient(np.gradient(targets, 1 / rate, axis=0), 1 / rate,
                                          axis=0)).max(axis=0) + 0.3 * gravity  # fmt: skip
    while True:
        hidden = _all_drawn(rng, kinds, names, inertia, effort)
        q, v = _simulated(model, names, targets, rate, kp, kd, hidden)
        if _counts(names, targets, rate, kp, kd, (q, v), hidden):
            break
    _write(case, rng, names, rate, targets, q, v)
    gains = {key: dict(zip(names, map(float, x), strict=True)) for key, x in
             (('kp', kp), ('kd', kd))}  # fmt: skip
    (case / 'gains.yaml').write_text(yaml.safe_dump(gains), encoding='utf-8')
    answer = {'family': family, 'rate_hz': rate, 'driven': names, 'hidden': hidden}
    (case / 'answer.json').write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')


def _all_drawn(rng, kinds, names, inertia, effort):
    hidden = [_drawn(rng, kind, names, inertia, effort) for kind in kinds]
    if kinds == (DRY, DRY):
        i, j = rng.choice(len(names), 2, replace=False)
        for entry, at in zip(hidden, (i, j), strict=True):
            level = float(0.2 * effort[at] * rng.uniform(0.5, 1.5))
            entry |= {'joint': names[at], 'parameters': {'level': level}}
    return hidden


def _counts(names, targets, rate, kp, kd, motion, hidden):
    """Return whether every component makes the least share of some joint's mean squared effort.

    That of the stated gains, which a diagnosis sees.
    """
    q, v = motion
    power = ((kp * (targets - q) - kd * v) ** 2).mean(axis=0)
    for h in hidden:
        p, j = h['parameters'], names.index(h['joint']) if h['joint'] in names else slice(None)
        if h['effect'] == GAIN:
            force = (p['kp'] - 1.0) * kp[j] * (targets - q)[:, j]
            force = force - (p['kd'] - 1.0) * kd[j] * v[:, j]
        elif h['effect'] == DELAY:
            force = kp * p['delay'] * np.gradient(targets, 1.0 / rate, axis=0)
        elif h['effect'] == ROTOR:
            force = p['inertia'] * np.gradient(v[:, j], 1.0 / rate)
        else:
            force = np.full(len(q), p['level'])
        if np.max((force**2).mean(axis=0) / power[j]) < LEAST_SHARE:
            return False
    return True


def _model(path):
    text, _ = write_mjcf(hand_over(nominal_model(load_robot(str(path)))), None, path.parent)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = _STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    return model


def _typical(model, bodies):
    """Return the diagonal of the mass matrix and the torque of gravity at the centre, (k,)."""
    data = mujoco.MjData(model)
    order = [model.joint(b.joint).id for b in bodies]
    data.qpos[order] = [b.centre for b in bodies]
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    for column in range(model.nv):
        mujoco.mj_mulM(model, data, M[column], np.eye(model.nv)[column])
    return np.diag(M)[order], np.abs(data.qfrc_bias[order])


def _targets(rng, bodies, rate):
    """Return sums of waves that start at rest, (n, k)."""
    t = np.arange(int(_LENGTH_S * rate)) / rate
    columns = []
    for body in bodies:
        waves = sum(
            rng.uniform(0.4, 1.0) * np.sin(2.0 * np.pi * rng.uniform(0.1, 1.3) * t + phase)
            for phase in rng.uniform(0.0, 2.0 * np.pi, 5)
        )
        span = min(body.span, 1.0) if not body.is_prismatic else body.span
        columns.append(body.centre + 0.7 * span * waves / np.abs(waves).max())
    smooth = np.clip(t / 2.0, 0.0, 1.0)[:, None]
    found = np.array(columns).T
    return found[0] + smooth * (found - found[0])


def _drawn(rng, kind, names, inertia, effort):
    j = int(rng.integers(1 if kind == ROTOR and len(names) > 1 else 0, len(names)))
    entry = {'effect': kind, 'joint': names[j]}
    if kind == GAIN:
        scale = np.exp(rng.choice([-1.0, 1.0], 2) * rng.uniform(0.15, 0.6, 2))
        return entry | {'parameters': {'kp': float(scale[0]), 'kd': float(scale[1])}}
    if kind == DELAY:
        delay = float(np.exp(rng.uniform(math.log(0.005), math.log(0.04))))
        delay = _STEP_S * round(delay / _STEP_S)
        return {'effect': kind, 'joint': 'all', 'parameters': {'delay': delay}}
    if kind == ROTOR:
        size = float(inertia[j] * np.exp(rng.uniform(math.log(0.1), math.log(0.8))))
        return entry | {'parameters': {'inertia': size}}
    return entry | {'parameters': {'level': float(effort[j] * rng.uniform(0.08, 0.35))}}


def _simulated(model, names, targets, rate, kp, kd, hidden):
    """Return positions and velocities at the times of the targets, (n, k) each."""
    order = [model.joint(name).id for name in names]
    model.dof_armature[:], model.dof_frictionloss[:] = 0.0, 0.0
    kp, kd, delay = kp.copy(), kd.copy(), 0.0
    for h in hidden:
        j, p = names.index(h['joint']) if h['joint'] in names else 0, h['parameters']
        if h['effect'] == GAIN:
            kp[j], kd[j] = kp[j] * p['kp'], kd[j] * p['kd']
        elif h['effect'] == DELAY:
            delay = p['delay']
        elif h['effect'] == ROTOR:
            model.dof_armature[order[j]] = p['inertia']
        else:
            model.dof_frictionloss[order[j]] = p['level']
            model.dof_solref[order[j]] = (0.001, 1.0)
            model.dof_solimp[order[j]] = (0.99, 0.9999, 1e-4, 0.5, 2.0)
    drives = [int(np.flatnonzero(model.actuator_trnid[:, 0] == i)[0]) for i in order]
    model.actuator_biastype[drives] = mujoco.mjtBias.mjBIAS_AFFINE
    model.actuator_ctrllimited[:], model.actuator_forcelimited[:] = 0, 0
    model.actuator_gainprm[drives, 0] = kp
    model.actuator_biasprm[drives, :3] = np.column_stack([0.0 * kp, -kp, -kd])
    data = mujoco.MjData(model)
    data.qpos[order] = targets[0]
    mujoco.mj_forward(model, data)
    found = np.empty((2, *targets.shape))
    for row in range(len(targets)):
        found[0, row], found[1, row] = data.qpos[order], data.qvel[order]
        while data.time < (row + 1) / rate - 0.5 * _STEP_S:
            data.ctrl[drives] = targets[max(int((data.time - delay) * rate + 1e-6), 0)]
            mujoco.mj_step(model, data)
    return found


def _write(case, rng, names, rate, targets, q, v):
    tick = 2.0 * np.pi / 2.0 ** int(rng.integers(16, 20))
    has_velocity = bool(rng.random() < 0.7)
    shown, noise = np.round(q / tick) * tick, 2e-3 * v.std(axis=0)
    with RecordingWriter(case / 'real.mcap', command_type=JOINT_STATE) as writer:
        for i, row in enumerate(shown):
            stamp = _STAMP_NS + round(i * 1e9 / rate)
            writer.write_event(
                CommandSample(stamp, frozen_array(targets[i]), tuple(names), POSITION)
            )
            velocity = frozen_array(v[i] + rng.normal(0.0, noise)) if has_velocity else None
            writer.write_event(JointSample(stamp, tuple(names), frozen_array(row), velocity))
