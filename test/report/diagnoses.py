"""Diagnoses of which all is known, for the laws of their report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.result import (
    Diagnosis,
    Finding,
    Location,
    Parameter,
    ParameterError,
    Proof,
)
from sgp_ros.diagnosis.shown import (
    Band,
    Dependence,
    LawSearch,
    Overlay,
    Replay,
    Traces,
    TriedFormula,
)

LEVEL, NOISE, N = 0.317, 0.004, 600
COULOMB = Finding(
    'elbow', 'coulomb_friction', {'level': Parameter(LEVEL, 0.001, 'N m')}, Location(), 900.0,
    0.99, 0.1, 'tau_x = -level sign(v)',
)  # fmt: skip
LOCAL = Finding(
    'elbow', 'position_friction',
    {
        'amplitude': Parameter(0.2, 0.01, 'N m'), 'lo': Parameter(-0.4, 0.01, 'rad'),
        'hi': Parameter(0.1, 0.01, 'rad'), 'kind': Parameter('viscous'),
    },
    Location(('position',), {'position': [[-0.4, 0.1]]}), 800.0, 0.9, 0.05, 'tau_x = ...',
)  # fmt: skip
SPRING = Finding(
    'shoulder', 'spring',
    {'stiffness': Parameter(2.0, 0.1, 'N m/rad'), 'rest': Parameter(0.3, None, 'rad')},
    Location(), 700.0, 0.8, 0.04, 'tau_x = -stiffness (q - rest)',
)  # fmt: skip
ASYMMETRIC = Finding(
    'elbow', 'asymmetric_coulomb',
    {'level_pos': Parameter(0.317, None, 'N m'), 'level_neg': Parameter(0.316, None, 'N m')},
    Location(), 895.0, 0.008, 0.1, 'tau_x = ...', 'leaves 1 %, the asserted model 1 %',
)  # fmt: skip
UNKNOWN = Finding('elbow', 'unknown', {}, Location(), 0.0, 0.9, 0.1, '', 'it depends on much')
MASS = ParameterError('fore', 'mass', 1.3, 0.02, 1.0, 'kg')


def diagnosis(
    verdict, findings=(), *, joints=('shoulder', 'elbow'), alternatives=(), errors=(), held=True
):
    """Return a diagnosis in which Coulomb friction on `elbow` is what the nominal robot lacks.

    Args:
        verdict: as in the schema; nothing but noise is left by the nominal robot in `no_mismatch`.
        findings: asserted.
        joints: names; one of them `elbow`.
        alternatives: not asserted.
        errors: of parameters.
        held: whether a recording was held out.
    """
    rng = np.random.default_rng(4)
    k, time = len(joints), np.arange(N) / 40.0
    rate = np.linspace(2.0, 3.0, k)
    position, velocity = np.sin(time[:, None] * rate), rate * np.cos(time[:, None] * rate)
    after = NOISE * rng.standard_normal((N, k))
    force = np.zeros((N, k))
    if verdict != 'no_mismatch':
        j = joints.index('elbow')
        force[:, j] = -LEVEL * np.sign(velocity[:, j])
    before = after + force
    left, final = ((x**2).mean(axis=0) for x in (before, after))
    proof = Proof(
        dict(zip(joints, left.tolist(), strict=True)),
        dict(zip(joints, final.tolist(), strict=True)),
        dict.fromkeys(joints, 0.2), dict.fromkeys(joints, 0.1), 1.0, -2.0,
        dict.fromkeys(joints, 0.09), dict.fromkeys(joints, 4e-4),
        {'rollout_nmse_after': dict.fromkeys(joints, (3e-4, 5e-4))},
        ((0.9, 1.1), None), 40, 0, 0.0,
    )  # fmt: skip
    far = replace(proof, distance=1.5, failed=3)
    scores = {'position': 0.1, 'velocity': 0.9, 'time': 0.0}
    chances = {'position': 0.02, 'velocity': 0.005, 'time': 0.7}
    return Diagnosis(
        'arm', tuple(joints), ('N m',) * k, verdict, 0.97, tuple(findings), tuple(alternatives),
        tuple(errors), {'train': proof} | ({'real_test': far} if held else {}), {},
        tuple(Dependence(name, 0.1, scores, chances) for name in joints),
        Traces(time, position, velocity, np.ones((N, k)), before, before, after,
               np.full(k, NOISE), tuple(force for f in findings if f is not UNKNOWN),
               np.ones((N, k), bool)),
        10.0, 40.0, N, {'duplicate': 3}, bands=tuple(_bands(joints)),
        overlays={
            stem: _overlay(time, position, before, after)
            for stem in ('train', *(['real_test'] if held else []))
        },
    )  # fmt: skip


def _bands(joints):
    """Yield Z of friction on `elbow`, with a gap where the joint never moved backward."""
    for joint in joints:
        level = LEVEL if joint == 'elbow' else 0.0
        for variable in ('position', 'velocity', 'time'):
            mean = np.tile([level, -level], (9, 1))
            mean[:2, 0] = np.nan
            regions = ((-2.0, -0.5), (0.5, 2.0)) if level and variable == 'velocity' else ()
            rows = 0.8 if regions else 0.0
            half = np.full((9, 2), 0.1)
            yield Band(joint, variable, np.linspace(-2.0, 2.0, 9), mean, half, regions, rows)


OFF = 0.1
"""Error of the nominal robot in every replay [rad]."""


def _overlay(time, position, before, after):
    """Return replays that are off by `OFF` with the nominal robot; it diverges after 2 s."""
    k = position.shape[1]
    far = np.where(time[:, None] % 2.0 < 1.0, position + OFF, np.nan)
    right = Replay(position, np.full(k, 0.01 * OFF))
    return Overlay(
        time, position, np.ones_like(before), {'nominal': 1.0 + before, 'diagnosed': 1.0 + after},
        {
            'open_0.5': {'nominal': Replay(position + OFF, np.full(k, OFF)), 'diagnosed': right},
            'open_2': {'nominal': Replay(far, np.full(k, np.nan)), 'diagnosed': right},
        },
        float(time[-1]),
    )  # fmt: skip


def search(why_not='the best formula follows the force only approximately'):
    """Return a search at `elbow` that ended with friction over a place."""
    x = np.linspace(-1.0, 1.0, 41)
    shape, beyond = 0.2 + 0.1 * x**2, np.linspace(-2.0, 2.0, 82)
    formula = TriedFormula(
        'tau_x[elbow] = (a*q[elbow]**2 + d)*sign(dq[elbow])',
        {'a': (0.1, 'N m/rad^2'), 'd': (0.2, 'N m')}, 0.01, 'a law found from the data', shape,
        0.2 + 0.1 * beyond**2, is_alike=True,
    )  # fmt: skip
    return LawSearch(
        'elbow', 'q[elbow]', 'sign(dq[elbow])', 'rad', 'N m', x, shape, np.full(41, 0.01), 0.008,
        0.03, (formula,), why_not, 'depends on the position of elbow: 0.3 N m at -1 rad', x, shape,
        beyond,
    )  # fmt: skip
