"""The DFKI double pendulum: roll-outs of 0.3 s on held-out runs, beside the published parameters.

python -m sgp_proof.real.double_pendulum

nMSE is the squared error of the position over that of holding the position from which the roll-out
starts, over all steps (`path`) and at the end (`end`). Runs alternate between training and test.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import yaml

from sgp_proof.environment import environment
from sgp_proof.real.pendulum_recordings import parameters, read_run, regression, row, with_terms
from sgp_ros.batch.rollout import roll_out
from sgp_ros.batch.rollout_fit import RolloutFitOptions, fit_rollouts
from sgp_ros.batch.rollout_scores import score_windows
from sgp_ros.batch.rollout_windows import joined
from sgp_ros.gp.methods import FitOptions, fit_gp
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.physics.term import Motion
from sgp_ros.robots.double_pendulum import DOUBLE_PENDULUM

DATA = Path(__file__).parents[3] / 'shared' / 'data' / 'dfki_double_pendulum'
RESULT = Path(__file__).parent / 'results' / 'double_pendulum.json'
DESIGNS = {'A.0': ('model_1.0', 'model_2.0'), 'C.0': ('model_3.0',)}
HORIZON, STRIDE = 0.3, 0.1
MODELS = {'rigid': 6, 'viscous': 8, 'Coulomb': 10, 'offset': 12}
LOWER = {'J1': 1e-6, 'J2': 1e-6, 'Fv1': 0.0, 'Fv2': 0.0, 'Fc1': 0.0, 'Fc2': 0.0}
Z_POINTS, Z_HORIZON = 200, 0.04


def _runs(design):
    runs = []
    for path in sorted(DATA.glob(f'design_{design}__*.npz')):
        with np.load(path, allow_pickle=False) as file:
            runs.append(read_run(path.stem[-2:], file['t'], file['q'], file['tau']))
    return runs


def _published(design, model):
    """Published link parameters as coefficients; cf is the factor of arctan(100 v)."""
    text = (DATA / f'params_design_{design}_{model}.yml').read_text(encoding='utf-8')
    p = yaml.safe_load(text)
    rotor, gear, l1, g = p['Ir'], p['gr'], p['l1'], p['g']
    return np.array([
        p['I1'] + p['I2'] + p['m2'] * l1**2 + (gear**2 + 1.0) * rotor, p['I2'] - gear * rotor,
        p['I2'] + gear**2 * rotor, p['m2'] * l1 * p['r2'], (p['m1'] * p['r1'] + p['m2'] * l1) * g,
        p['m2'] * p['r2'] * g, p['b1'], p['b2'], p['cf1'], p['cf2'], 0.0, 0.0,
    ])  # fmt: skip


def _process(robot, W, runs):
    """Z: a process on what the physics leaves of the torque over a short roll-out."""
    short = joined([run.windows(Z_HORIZON, Z_HORIZON) for run in runs])
    q, v = roll_out(robot, W, short.q[:, 0], short.v[:, 0], short.effort, short.step)
    left = (short.v[:, -1] - v[:, -1]) / short.horizon  # acceleration that is missing
    middle = short.q.shape[1] // 2
    q, v = short.q[:, middle], short.v[:, middle]
    rest, unit = np.zeros_like(q), np.eye(2)
    still = robot.regressor(Motion(q, rest, rest, rest)) @ W
    mass = np.stack(
        [robot.regressor(Motion(q, rest, rest + e, rest)) @ W - still for e in unit], axis=2
    )
    torque = -np.einsum('mij,mj->mi', mass, left)
    chosen = np.random.default_rng(0).permutation(len(q))[:Z_POINTS]
    U = np.hstack([q, v])[chosen]
    data = Observations(U, np.zeros((len(U), 2, 0)), torque[chosen])
    fitted = fit_gp(data, CoefficientPrior.flat(0), ((0, 1, 2, 3),) * 2, FitOptions())

    def residual(q, v):
        return fitted.predict(np.hstack([q, v]), np.zeros((len(q), 2, 0))).mean

    return residual


def _design(design, published):
    runs = _runs(design)
    learn, test = runs[0::2], runs[1::2]
    training = joined([run.windows(HORIZON, STRIDE) for run in learn])
    held_out = joined([run.windows(HORIZON, STRIDE) for run in test])
    rows, identified = {}, {}

    def report(name, robot, W, residual=None):
        rows[name] = row(score_windows(held_out, robot, W, residual=residual))
        path, end = (np.round(rows[name][f'nmse_{kind}'], 5) for kind in ('path', 'end'))
        diverged = rows[name]['diverged']
        print(f'{design} {name:28s} path {path} end {end} diverged {diverged}', flush=True)

    for model in published:
        W = _published(design, model)
        report(f'published {model}', DOUBLE_PENDULUM, W)
        level = W * np.where(np.arange(12) // 2 == 4, 0.5 * np.pi, 1.0)
        report(f'published {model}, cf pi/2', DOUBLE_PENDULUM, level)
    report('regression, all terms', DOUBLE_PENDULUM, regression(DOUBLE_PENDULUM, learn))
    for name, terms in MODELS.items():
        robot = with_terms(DOUBLE_PENDULUM, terms)
        known = {c.name for c in robot.coefficients}
        options = RolloutFitOptions(lower={k: v for k, v in LOWER.items() if k in known})
        fit = fit_rollouts(training, robot, regression(robot, learn), options)
        report(name, robot, fit.W)
        identified[name] = {
            'parameters': parameters(robot, fit),
            'upper_link_length_m': float(9.81 * fit.W[3] / fit.W[5]),
            'training_error_std_rad': fit.error_std.tolist(),
            'training_diverged': fit.diverged,
            'is_converged': fit.is_converged,
        }
        if name in ('Coulomb', 'offset'):
            report(f'{name} + Z', robot, fit.W, _process(robot, fit.W, learn))
    return {
        'training_runs': [run.name for run in learn],
        'held_out_runs': [run.name for run in test],
        'held_out': rows,
        'identified': identified,
        'published': {model: _published(design, model).tolist() for model in published},
    }


def main() -> None:
    """Fit on every other run, score on the others, write the result."""
    result = {
        'schema': 1,
        'environment': environment(),
        'horizon_s': HORIZON,
        'stride_s': STRIDE,
        'designs': {design: _design(design, models) for design, models in DESIGNS.items()},
    }
    RESULT.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
