"""Refusals of the gates on clean streams, and traces left by garbage, by seed.

    python -m sgp_proof.robustness.gates [clean|garbage ...] [--seeds 0:60]

`clean` are simulated robots, half of them with effects that the model lacks, impacts and dry
friction among them: every equation refused there is a false refusal. `garbage` is a clean stream
with something wrong in it, compared with the stream as it was, on the clean data from as many
equations after the garbage as the buffer holds. A third run, in which the same messages are lost,
tells how much any change of the data changes a score: a fit of hyper-parameters may end in another
optimum.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from sgp_proof.result_files import make_parser, read_result, seed_range, write_result
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.physics import catalogue as laws
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

ROBOTS = {
    'reaction_wheel': ('pole', ('pole', 'wheel')),
    'toy_pendulum': ('hinge', ('hinge',)),
    'linear_axis': ('axis', ('axis',)),
}
"""Robot to the joint whose garbage is tried, and its joints."""
EFFECTS = (
    f'{laws.COULOMB_FRICTION.name}:level=0.02', f'{laws.VISCOUS_FRICTION.name}:b=0.01',
    f'{laws.QUADRATIC_DRAG.name}:c=0.01',
    f'{laws.STRIBECK_FRICTION.name}:coulomb=0.02,static=0.03,stribeck_velocity=0.1',
    f'{laws.END_STOP.name}:position=0.5,stiffness=200,damping=1',
    f'{laws.HYSTERESIS.name}:level=0.02,presliding=0.01',
    f'{laws.COGGING.name}:amplitude=0.02,periods=6,phase=0',
    f'{laws.SPRING.name}:stiffness=0.1,rest=0', f'{laws.CONSTANT_LOAD.name}:force=0.05',
)  # fmt: skip
CLEAN_S, GARBAGE_S, RATE_HZ = 60.0, 60.0, 100.0
BUDGET = 300
GARBAGE = ('glitch', 'early glitch', 'glitches', 'effort', 'burst', 'long burst', 'numbers')
WITHIN = 1.1


def _world(name, seed, seconds, effects=()):
    run = simulate(
        make_simulation(
            name, seed=seed, rate_hz=RATE_HZ, effects=effects, start_ns=1_700_000_000 * 10**9
        ),
        seconds,
    )
    events = []
    for stamp, position, command in zip(run.stamps_ns, run.position, run.command, strict=True):
        events.append(CommandSample(int(stamp), frozen_array(command)))
        events.append(JointSample(int(stamp), run.joint_names, frozen_array(position)))
    return events


def _run(name, events):
    robot = load_robot(name)
    engine = Engine(robot, EngineConfig.from_mapping({'buffer.budget': BUDGET}, robot))
    estimates = []
    replay(engine, events, lambda step: estimates.extend(step.estimates))
    return engine, estimates


def _clean(seed):
    rng = np.random.default_rng((seed, 2))
    name = str(rng.choice(list(ROBOTS)))
    effects = ()
    if rng.integers(2):
        effects = (f'{rng.choice(EFFECTS)},joint={rng.choice(ROBOTS[name][1])}',)
    engine, _ = _run(name, _world(name, seed, CLEAN_S, effects))
    return {
        'robot': name, 'effects': list(effects), 'equations': engine.counts.estimated,
        'refused': engine.counts.implausible, 'reverted': engine.counts.reverted,
    }  # fmt: skip


def _spoiled(events, kind, joint, rng):
    """Return events with something wrong, and the stamp of the last of it."""
    events = list(events)
    states = [i for i, event in enumerate(events) if isinstance(event, JointSample)]
    size = 10.0 ** rng.uniform(-1.0, 8.0) * rng.choice([-1.0, 1.0])
    first = int(rng.uniform(0.25, 0.4) * len(states))
    length = {'burst': 60, 'long burst': 400}.get(kind, 1)
    places = states[first : first + length]
    if kind == 'early glitch':
        places = [states[int(rng.integers(3, 200))]]
    if kind == 'glitches':
        places = sorted(states[int(i)] for i in first + rng.integers(0, 1000, size=20))
    for i in places:
        event = events[i]
        if kind == 'effort':
            command = events[i - 1]
            wrong = frozen_array([size] * len(command.effort))
            events[i - 1] = replace(command, effort=wrong)
            continue
        position = event.position.copy()
        at = event.names.index(joint)
        if kind == 'numbers':
            position[at] = rng.choice([np.nan, np.inf, 1e200, -1e300])
        else:
            position[at] += size * (rng.normal() if 'burst' in kind else 1.0)
        events[i] = replace(event, position=frozen_array(position))
    return events, events[places[-1]].stamp_ns, size


def _nmse(estimates, target, first_ns):
    chosen = [getattr(e, target) for e in estimates if e.is_scored and e.stamp_ns >= first_ns]
    error = np.array([c.measured - c.mean for c in chosen])
    measured = np.array([c.measured for c in chosen])
    return np.nanmean(error**2, axis=0) / measured.var(axis=0), len(chosen)


def _garbage(seed):
    rng = np.random.default_rng((seed, 3))
    name = str(rng.choice(list(ROBOTS)))
    joint = ROBOTS[name][0]
    kind = GARBAGE[seed % len(GARBAGE)]
    events = _world(name, seed, GARBAGE_S)
    wrong, last_ns, size = _spoiled(events, kind, joint, rng)
    lost = [event for event, other in zip(events, wrong, strict=True) if event is other]
    engine, without = _run(name, events)
    _, missing = _run(name, lost)
    other, found = _run(name, wrong)
    later = [e.stamp_ns for e in found if e.stamp_ns > last_ns]
    target = engine.robot.target
    (nmse, n), (expected, _), (less, _) = (
        _nmse(e, target, later[BUDGET]) for e in (found, without, missing)
    )
    ratio = nmse / expected
    return {
        'robot': name, 'kind': kind, 'size': float(size), 'equations': n,
        'nmse': float(expected.max()),
        'ratio': float(ratio.max()), 'ratio_lost': float((less / expected).max()),
        'refused': other.counts.implausible,
        'reverted': other.counts.reverted,
    }  # fmt: skip


PARTS = {'clean': _clean, 'garbage': _garbage}


def _summary(found):
    rows = found.get('clean', [])
    summary = {
        'equations': sum(row['equations'] for row in rows),
        'falsely_refused': sum(row['refused'] for row in rows),
    }
    for kind in GARBAGE:
        rows = [row for row in found.get('garbage', []) if row['kind'] == kind]
        ratios, lost = ([row[name] for row in rows] for name in ('ratio', 'ratio_lost'))
        if ratios:
            summary[kind] = {
                'streams': len(ratios), 'within_10_percent': sum(r <= WITHIN for r in ratios),
                'median': float(np.median(ratios)), 'worst': max(ratios), 'worst_lost': max(lost),
            }  # fmt: skip
    return summary


def main():
    """Run the named parts over the seeds and write the result."""
    parser = make_parser(__doc__, 'robust_gates', PARTS)
    parser.add_argument('--seeds', type=seed_range, default=range(60), metavar='FIRST:LAST+1')
    parser.add_argument('--minutes', type=float, default=1e9, help='after which no seed begins')
    arguments = parser.parse_args()
    end = time.monotonic() + 60.0 * arguments.minutes
    found = read_result(arguments.out)
    for name in arguments.names:
        known = {row['seed']: row for row in found.get(name, [])}
        for seed in arguments.seeds:
            if time.monotonic() > end:
                break
            known[seed] = {'seed': seed, **PARTS[name](seed)}
            print(name, known[seed], flush=True)
        found[name] = [known[seed] for seed in sorted(known)]
    result = {'budget': BUDGET, 'rate_hz': RATE_HZ, 'summary': _summary(found)}
    result |= {name: found[name] for name in PARTS if name in found}
    write_result(arguments.out, result)
    print(result['summary'])


if __name__ == '__main__':
    main()
