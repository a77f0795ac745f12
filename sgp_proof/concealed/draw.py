"""Worlds with concealed physics: recordings of each and the right answers.

    python -m sgp_proof.concealed.draw --seeds 0:40 --tier B --out DIR [--only EFFECT]

writes `DIR/cases/case_NNN/{robot.urdf,sim.mcap,real.mcap,real_test.mcap,real_far.mcap}`,
`DIR/answers/case_NNN.json` and `DIR/answers/case_NNN_truth.npz`. Tier A is clean, tier B has
smaller effects, worse sensors, wrong parameters and pairs. Without `--only` the seed says what
is concealed: every effect in turn, and in between unknown ones, wrong parameters, nothing, pairs.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from sgp_proof.concealed import answers, balance, sizes
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.kinds import draw_effect, draw_unlisted
from sgp_proof.concealed.robots import urdf
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.physics.catalogue import PAYLOAD, VELOCITY_FILTER_LAG
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.simulation.registry import LAWS
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.transport import Transport

NOTHING, PARAMETERS, UNKNOWN, PAIR = 'none', 'parameters', 'unknown', 'pair'
UNLISTED = 'unlisted'
FIRST_LAWS = list(LAWS)[:27]
"""Those from which the worlds of the committed results are drawn."""
FIRST_PLAN = [
    *FIRST_LAWS[:7], NOTHING, PARAMETERS, UNKNOWN, PAIR, *FIRST_LAWS[7:14], UNKNOWN,
    NOTHING, PARAMETERS, *FIRST_LAWS[14:21], PAIR, UNKNOWN, *FIRST_LAWS[21:], NOTHING,
    PARAMETERS,
]  # fmt: skip
PLAN = [*FIRST_PLAN, *list(LAWS)[27:]]
GROWN = 1000
"""Seeds from here on draw from all laws, by the whole plan."""
TOPIC = '/effort_controller/commands'
_PERFECT = Transport(log_latency_s=1e-4)
_TRIES = 60
_SECONDS = {'real': 33.0, 'real_test': 12.0, 'real_far': 12.0}
_NUMBERS = {'real': 1, 'real_test': 2, 'real_far': 3}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:40', help='FIRST:LAST+1')
    parser.add_argument('--tier', choices=('A', 'B'), default='A')
    parser.add_argument('--out', type=Path, required=True)
    parser.add_argument('--only', choices=(*LAWS, NOTHING, PARAMETERS, UNKNOWN, UNLISTED, PAIR))
    arguments = parser.parse_args()
    first, last = (int(x) for x in arguments.seeds.split(':'))
    for folder in ('cases', 'answers'):
        (arguments.out / folder).mkdir(parents=True, exist_ok=True)
    for seed in range(first, last):
        begin = time.perf_counter()
        line = draw_case(seed, arguments.tier, arguments.only, arguments.out)
        print(f'{line}  {time.perf_counter() - begin:.1f} s', flush=True)


def planned(seed):
    """Return what a seed conceals."""
    plan = PLAN if seed >= GROWN else FIRST_PLAN
    return plan[seed % len(plan)]


def draw_case(seed, tier, only, out):
    """Write one case and return a line about it."""
    wanted = only or planned(seed)
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed, ord(tier), attempt])
        try:
            return _attempt(seed, rng, tier, wanted, out)
        except UnsuitableError as problem:
            print(f'  seed {seed}: {problem}', file=sys.stderr)
    return f'case_{seed:03d} {wanted}: no suitable world in {_TRIES}'


def _attempt(seed, rng, tier, wanted, out):
    names = _names(rng, wanted, LAWS if seed >= GROWN else FIRST_LAWS)
    world = worlds.draw_world(seed, rng, tier, _largest_error(rng, tier, wanted, names))
    world, motion, relative = observed(
        rng, world, tier, needs_velocity=VELOCITY_FILTER_LAG.name in names
    )
    concealed = [
        draw_unlisted(rng, seed, world.bodies, motion) if name == UNLISTED
        else draw_effect(rng, name, world.bodies, motion, tier == 'B')
        for name in names
    ]  # fmt: skip
    for effect in concealed:
        low, high = sizes.targets(effect, tier)
        sizes.sized(world, effect, math.exp(rng.uniform(math.log(low), math.log(high))))
    recordings = run_all(world, concealed)
    _check(recordings['real'], world, concealed)
    return write_case(seed, tier, wanted, out, rng, world, concealed, recordings, motion, relative)


def observed(rng, world, tier, *, needs_velocity=False):
    """Return the world with noise of its velocities, its usual motion, and that noise."""
    motion = balance.pilot_motion(world.run('near', 12.0, 1), world)
    relative = 0.002 if tier == 'A' else float(rng.choice([0.01, 0.03]))
    noise = tuple(float(relative * v) for v in motion.velocity)
    has_velocity = world.sensors.measures_velocity or needs_velocity
    sensors = replace(world.sensors, velocity_noise=noise, measures_velocity=has_velocity)
    return replace(world, sensors=sensors), motion, relative


def run_all(world, concealed):
    """Return the recordings of a world by name."""
    recordings = {
        name: world.run('far' if name == 'real_far' else 'near', seconds, number, concealed)
        for (name, seconds), number in zip(_SECONDS.items(), _NUMBERS.values(), strict=True)
    }
    perfect = Sensors(measures_velocity=True, command_latency_s=world.sensors.command_latency_s)
    recordings['sim'] = world.run('near', 12.0, 4, is_nominal=True, sensors=perfect)
    return recordings


def _names(rng, wanted, laws):
    if wanted in {NOTHING, PARAMETERS}:
        return []
    if wanted == PAIR:
        return [str(name) for name in rng.choice(list(laws), 2, replace=False)]
    return [wanted]


def _largest_error(rng, tier, wanted, names):
    if wanted == PARAMETERS:
        return 0.3
    if not names or PAYLOAD.name in names or tier == 'A' or rng.random() < 0.4:
        return 0.0
    return 0.3 if rng.random() < 0.5 else 0.1


def draw_transport(rng, tier):
    if tier == 'A':
        return _PERFECT
    return Transport(
        stamp_noise_s=float(rng.choice([0.0, 4e-5])),
        log_latency_s=float(rng.choice([5e-4, 1.5e-3])),
        drop=float(rng.choice([0.0, 0.0, 0.005])),
        is_permuted=bool(rng.random() < 0.5),
        has_named_commands=bool(rng.random() < 0.3),
    )


def _check(real, world, concealed):
    """Refuse a world in which a concealed effect does not count as physics."""
    for effect, alone in zip(concealed, _alone(real, world, concealed), strict=True):
        if not sizes.is_suitable(alone, world, effect):
            share = sizes.own_share(alone, world, effect)
            raise UnsuitableError(f'{effect.at.name} makes {share:.2e}')
    if not concealed and world.errors:
        error = max(x['nominal'] for x in balance.nominal_share(real, world).values())
        if error < sizes.SMALLEST_SHARE:
            raise UnsuitableError(f'wrong parameters make {error:.2e}')


def own_shares(real, world, concealed):
    """Return the share of each concealed effect alone."""
    runs = _alone(real, world, concealed)
    return [sizes.own_share(x, world, e) for x, e in zip(runs, concealed, strict=True)]


def _alone(real, world, concealed):
    """Return a recording with each effect alone; each of several needs a run of its own."""
    return [
        real if len(concealed) == 1 else world.run('near', 12.0, 1, [effect])
        for effect in concealed
    ]


def write_case(seed, tier, wanted, out, rng, world, concealed, recordings, motion, relative):
    """Write recordings and answers of a world and return a line about it."""
    case, names = f'case_{seed:03d}', [body.joint for body in world.bodies]
    folder = out / 'cases' / case
    folder.mkdir(exist_ok=True)
    (folder / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
    transport = draw_transport(rng, tier)
    for number, (name, recording) in enumerate(recordings.items()):
        write_simulated(
            recording, folder / f'{name}.mcap', _PERFECT if name == 'sim' else transport,
            seed=10 * seed + number, command_topic=TOPIC,
        )  # fmt: skip
    real, held_out = recordings['real'], {n: recordings[n] for n in ('real_test', 'real_far')}
    if concealed:
        verdict = (
            'unexplained' if any(e.at.name == UNKNOWN for e in concealed) else 'missing_physics'
        )
        right = [a for e in concealed for a in answers.accepted(e, world.bodies, motion)]
    else:
        verdict, right = answers.without_effect(world.errors, world.bodies)
    q, sensors, share = real.shown_position, world.sensors, sizes.shares(real, world)
    nmse = {
        name: balance.recording_scores(recording, world, name != 'real')
        for name, recording in (('real', real), *held_out.items())
    }
    answer = {
        'case': case, 'key': f'{tier}_{wanted}_{world.family}', 'tier': tier, 'note': '',
        'robot': world.family, 'joints': names, 'verdict': verdict,
        'effects': [answers.effects_entry(e, world.bodies) for e in concealed],
        'accepted': right, 'location': [e.location for e in concealed if e.location],
        'parameter_errors': world.errors,
        'joint_range': {n: [float(q[:, i].min()), float(q[:, i].max())]
                        for i, n in enumerate(names)},
        'sensor': {
            'resolution': list(sensors.resolution), 'measures_velocity': sensors.measures_velocity,
            'measures_effort': sensors.measures_effort, 'jitter_s': sensors.jitter_s,
            'vel_rel': relative, 'vel_noise': list(sensors.velocity_noise),
            **asdict(transport),
        },
        'rate_hz': world.rate_hz, 'bandwidth_rad_s': world.bandwidth,
        'durations': {'sim': 12.0, **_SECONDS},
        'effect_share_of_torque': dict(zip(names, share.tolist(), strict=True)),
        'nominal_nmse_true_signals': {
            name: x['nominal'] for name, x in nmse['real']['torque'].items()
        },
        'nmse': nmse, 'fit_scored': bool(concealed or world.errors),
    }  # fmt: skip
    path = out / 'answers' / case
    path.with_suffix('.json').write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')
    signals = {}
    for name, recording in held_out.items():
        signals[f'{name}_t'] = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
        signals[f'{name}_a'] = recording.true_acceleration.astype(np.float32)
    np.savez(out / 'answers' / f'{case}_truth.npz', **signals)
    what = ', '.join(f'{e.at.name}@{e.at.joint}' for e in concealed) or wanted
    return f'{case} {tier} {world.family:9s} {what} {" ".join(f"{x:.4f}" for x in share)}'


if __name__ == '__main__':
    main()
