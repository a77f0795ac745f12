"""Roll-outs of the DFKI pendulums, simple and double, on recordings held out.

    python -m sgp_proof.real.pendulums [double] [simple]

nMSE is the squared error of the position over that of holding the position from which the roll-out
starts, over all steps (`path`) and at the end (`end`). Runs of the double pendulum alternate
between training and test, beside the published parameters. Each recording of the simple one is
cut before hands or a balancing controller act on it; its coefficients are scored on itself and,
where the pendulum is the same, on the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import yaml
from scipy import signal

from sgp_proof.real.recordings import DATA, SIMPLE, UNDISTURBED_S
from sgp_proof.real.rollout_fit import RolloutFitOptions, fit_rollouts
from sgp_proof.result_files import RESULTS, make_parser, write_result
from sgp_ros.batch.rollout import cut_windows, joined, roll_out
from sgp_ros.batch.rollout_scores import score_windows
from sgp_ros.gp.methods import FitOptions, fit_gp
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot

SIMPLE_PENDULUM = load_robot('simple_pendulum')
DOUBLE_PENDULUM = load_robot('double_pendulum')

SMOOTHING_HZ, GRID, STEP = 25.0, 0.002, 0.004
DOUBLE_DATA = DATA / 'dfki_double_pendulum'
DESIGNS = {'A.0': ('model_1.0', 'model_2.0'), 'C.0': ('model_3.0',)}
HORIZON, STRIDE = 0.3, 0.1
DOUBLE_TERMS = {'rigid': 6, 'viscous': 8, 'Coulomb': 10, 'offset': 12}
SIMPLE_TERMS = {'rigid': 2, 'viscous': 3, 'Coulomb': 4, 'offset': 5}
LOWER = {'J1': 1e-6, 'J2': 1e-6, 'Fv1': 0.0, 'Fv2': 0.0, 'Fc1': 0.0, 'Fc2': 0.0,
         'J': 1e-6, 'Fv': 0.0, 'Fc': 0.0}  # fmt: skip
Z_POINTS, Z_HORIZON = 200, 0.04
SAME = {'energy_shaping': ('sac',), 'sac': ('energy_shaping',), 'energy_shaping_1kg': ()}
SIMPLE_STRIDE, SIMPLE_STEP = 0.05, 0.01
FITTED = {'1 s': 1.0, 'whole': None}
HORIZONS = {'0.3 s': 0.3, '1 s': 1.0, 'whole': None}
GRAVITY = 9.81


@dataclass(frozen=True)
class Run:
    """A recording on a uniform grid: q and tau as measured, the others zero-phase low-passed."""

    name: str
    time: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    motion: Motion

    def windows(self, horizon, stride, step=STEP):
        """Roll-outs start at the measured position and the smoothed velocity."""
        return cut_windows(
            self.time, self.q, self.motion.velocity, self.tau, horizon, stride, step
        )


def read_run(name, time, q, tau):
    """Bring (s, k) arrays to the grid and smooth them forwards and backwards."""
    grid = np.arange(time[0], time[-1], GRID)
    q, tau = (
        np.stack([np.interp(grid, time, column) for column in x.T], axis=1) for x in (q, tau)
    )
    low_pass = signal.butter(2, 2.0 * GRID * SMOOTHING_HZ, output='sos')

    def smooth(x):
        return signal.sosfiltfilt(low_pass, x, axis=0)

    position = smooth(q)
    velocity = np.gradient(position, GRID, axis=0)
    acceleration = smooth(np.gradient(velocity, GRID, axis=0))
    return Run(name, grid, q, tau, Motion(position, velocity, acceleration, smooth(tau)))


def _with_terms(robot, n):
    """The robot with the first n of its terms."""
    return replace(robot, terms=robot.terms[:n])


def _regression(robot, runs):
    """Least squares on the inverse model, every tenth sample, ends left out."""
    rows, targets = [], []
    for run in runs:
        inner = slice(50, -50, 10)
        m = run.motion
        part = Motion(m.position[inner], m.velocity[inner], m.acceleration[inner], m.effort[inner])
        rows.append(robot.regressor(part).reshape(-1, len(robot.coefficients)))
        targets.append(part.effort.ravel())
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)[0]


def _fit(robot, windows, start):
    known = {c.name for c in robot.coefficients}
    options = RolloutFitOptions(lower={k: v for k, v in LOWER.items() if k in known})
    return fit_rollouts(windows, robot, start, options)


def _row(score):
    """A score as it goes into a result file."""
    return {
        'horizon_s': score.horizon, 'rollouts': score.n, 'diverged': score.diverged,
        'nmse_path': score.nmse_path.tolist(), 'nmse_end': score.nmse_end.tolist(),
        'rms_path_rad': score.rms_path.tolist(), 'rms_end_rad': score.rms_end.tolist(),
    }  # fmt: skip


def _parameters(robot, fit):
    """Coefficients with their units and standard deviations, null where there is none."""
    return {
        c.name: {
            'value': float(value),
            'std': float(std) if np.isfinite(std) else None,
            'unit': c.unit,
        }
        for c, value, std in zip(robot.coefficients, fit.W, fit.std, strict=True)
    }


def _published(design, model):
    """Published link parameters as coefficients; cf is the factor of arctan(100 v)."""
    text = (DOUBLE_DATA / f'params_design_{design}_{model}.yml').read_text(encoding='utf-8')
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
    runs = []
    for path in sorted(DOUBLE_DATA.glob(f'design_{design}__*.npz')):
        with np.load(path, allow_pickle=False) as file:
            runs.append(read_run(path.stem[-2:], file['t'], file['q'], file['tau']))
    learn, test = runs[0::2], runs[1::2]
    training = joined([run.windows(HORIZON, STRIDE) for run in learn])
    held_out = joined([run.windows(HORIZON, STRIDE) for run in test])
    rows, identified = {}, {}

    def report(name, robot, W, residual=None):
        rows[name] = _row(score_windows(held_out, robot, W, residual=residual))
        path, end = (np.round(rows[name][f'nmse_{kind}'], 5) for kind in ('path', 'end'))
        diverged = rows[name]['diverged']
        print(f'{design} {name:28s} path {path} end {end} diverged {diverged}', flush=True)

    for model in published:
        W = _published(design, model)
        report(f'published {model}', DOUBLE_PENDULUM, W)
        level = W * np.where(np.arange(12) // 2 == 4, 0.5 * np.pi, 1.0)
        report(f'published {model}, cf pi/2', DOUBLE_PENDULUM, level)
    report('regression, all terms', DOUBLE_PENDULUM, _regression(DOUBLE_PENDULUM, learn))
    for name, terms in DOUBLE_TERMS.items():
        robot = _with_terms(DOUBLE_PENDULUM, terms)
        fit = _fit(robot, training, _regression(robot, learn))
        report(name, robot, fit.W)
        identified[name] = {
            'parameters': _parameters(robot, fit),
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


def _double():
    return {
        'horizon_s': HORIZON,
        'stride_s': STRIDE,
        'designs': {design: _design(design, models) for design, models in DESIGNS.items()},
    }


def _simple_run(name):
    table = np.genfromtxt(DATA / SIMPLE.format(name), delimiter=',', names=True)
    inside = table['t_s'] <= UNDISTURBED_S[name]
    time, q, tau = (table[c][inside] for c in ('t_s', 'q_rad', 'tau_Nm'))
    return read_run(name, time, q[:, None], tau[:, None])


def _scores(run, robot, W):
    return {
        name: _row(score_windows(run.windows(horizon, SIMPLE_STRIDE, SIMPLE_STEP), robot, W))
        for name, horizon in HORIZONS.items()
    }


def _recording(run, runs):
    """Per fitted horizon and model: coefficients and scores.

    Regression ends far off as soon as friction is in it, so each model starts from the one before,
    and the fit to the whole run from that to windows.
    """
    results, found = {}, {}
    for horizon, seconds in FITTED.items():
        before = _regression(_with_terms(SIMPLE_PENDULUM, 2), [run])
        results[horizon] = {}
        for model, terms in SIMPLE_TERMS.items():
            robot = _with_terms(SIMPLE_PENDULUM, terms)
            start = found.get(model, np.append(before, np.zeros(terms - len(before))))
            fit = _fit(robot, run.windows(seconds, SIMPLE_STRIDE, SIMPLE_STEP), start)
            before = found[model] = fit.W
            results[horizon][model] = {
                'parameters': _parameters(robot, fit),
                'in_sample': _scores(run, robot, fit.W),
                'held_out': {o: _scores(runs[o], robot, fit.W) for o in SAME[run.name]},
                'is_converged': fit.is_converged,
            }
            print(f'{run.name:20s}{horizon:6s}{model:8s} W {np.round(fit.W, 4)}', flush=True)
    return results


def _weight(model):
    """Length and mass of the point mass that J and G describe, in units of the measured torque."""
    J, G = (model['parameters'][c]['value'] for c in ('J', 'G'))
    return {'length_m': GRAVITY * J / G, 'mass_kg': (G / GRAVITY) ** 2 / J, 'G_N_m': G}


def _change(weights):
    heavy = weights['energy_shaping_1kg']
    return {
        name: {
            'mass_kg': heavy['mass_kg'] - weights[name]['mass_kg'],
            'G_ratio': heavy['G_N_m'] / weights[name]['G_N_m'],
        }
        for name in ('energy_shaping', 'sac')
    }


def _simple():
    runs = {name: _simple_run(name) for name in UNDISTURBED_S}
    recordings = {name: _recording(run, runs) for name, run in runs.items()}
    weights = {
        horizon: {name: _weight(found[horizon]['offset']) for name, found in recordings.items()}
        for horizon in FITTED
    }
    return {
        'seconds': UNDISTURBED_S, 'recordings': recordings, 'equivalent_point_mass': weights,
        'change_with_the_heavier_weight': {h: _change(weights[h]) for h in FITTED},
    }  # fmt: skip


PARTS = {'double': _double, 'simple': _simple}


def main() -> None:
    """Fit, score and write the results."""
    parser = make_parser(__doc__, '', PARTS)
    parser.set_defaults(out=RESULTS)
    arguments = parser.parse_args()
    for name in arguments.names:
        write_result(arguments.out / f'{name}_pendulum.json', PARTS[name]())


if __name__ == '__main__':
    main()
