"""Machines whose simulation has physics of its own, diagnosed with `--sim` and scored.

    python -m sgp_proof.connection.simulated --seeds 0:20 [--outputs DIR]

Simulation and machine have one or two frictions that the robot's file lacks. The seed says in what
they differ: in the size of one of them, in a law that the machine or the simulation has alone, or
in nothing. A case counts as right where what differs is named with its joint, and the difference
lies within three standard deviations or a tenth of the truth, and nothing else is asserted; where
nothing differs, where the verdict says so. Results go to `sgp_proof/results/simulated.json`.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace

from sgp_proof.concealed import sizes
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.draw import TOPIC, draw_transport, observed
from sgp_proof.concealed.kinds import draw_effect
from sgp_proof.concealed.robots import urdf
from sgp_proof.connection.seeds import draw_suitable, score_seeds
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.physics.catalogue import (
    ARMATURE,
    COMMAND_DELAY,
    CONSTANT_LOAD,
    COULOMB_FRICTION,
    EFFECTS,
    SPRING,
    VISCOUS_FRICTION,
)
from sgp_ros.physics.drawing import UnsuitableError

SIZE, MACHINE, SIMULATION, NOTHING = 'size', 'machine', 'simulation', 'nothing'
PLAN = (SIZE, MACHINE, SIMULATION, NOTHING, SIZE)
_FRICTION = (COULOMB_FRICTION.name, VISCOUS_FRICTION.name)
_OTHER = (*_FRICTION, ARMATURE.name, SPRING.name, COMMAND_DELAY.name, CONSTANT_LOAD.name)
_SIZES = {name: EFFECTS[name].quantities[0].name for name in _OTHER}
_SECONDS = 25.0
_CLOSE, _STD = 0.1, 3.0


def main():
    score_seeds(__doc__, 'simulated', draw_case, scored, summary)


def draw_case(seed, sealed, answer_file):
    """Write recordings, robot and answer of a world; return whether there is one."""
    return draw_suitable(seed, 'R', lambda rng: _attempt(seed, rng, sealed, answer_file))


def _attempt(seed, rng, sealed, answer_file):
    world = worlds.draw_world(seed, rng, 'B', 0.0)
    world, motion, _ = observed(rng, world, 'B')
    kind = PLAN[seed % len(PLAN)]
    both = [_sized(rng, world, motion, _FRICTION) for _ in range(int(rng.integers(1, 3)))]
    ours, theirs, differs = list(both), list(both), []
    if kind == SIZE:
        factor = math.exp(float(rng.choice([-1.0, 1.0])) * rng.uniform(0.4, 0.9))
        ours[0] = replace(both[0], size=factor * both[0].size)
        if sizes.own_share(world.run('near', 10.0, 1, [both[0]]), world, both[0]) * (
            factor - 1.0) ** 2 < sizes.SMALLEST_SHARE:  # fmt: skip
            raise UnsuitableError('the same, within what counts')
        differs = [(ours[0], both[0])]
    elif kind != NOTHING:
        own = _sized(rng, world, motion, _OTHER)
        (ours if kind == MACHINE else theirs).append(own)
        differs = [(own, None) if kind == MACHINE else (None, own)]
    if any(len({(e.at.name, e.at.joint) for e in side}) < len(side) for side in (ours, theirs)):
        raise UnsuitableError('one effect twice')
    real, sim = world.run('near', _SECONDS, 1, ours), world.run('near', _SECONDS, 4, theirs)
    sealed.mkdir(parents=True, exist_ok=True)
    answer_file.parent.mkdir(parents=True, exist_ok=True)
    (sealed / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
    for name, shown in (('real', real), ('sim', sim)):
        transport = draw_transport(rng, 'B')
        write_simulated(shown, sealed / f'{name}.mcap', transport, seed=seed, command_topic=TOPIC)
    answer = {
        'robot': world.family, 'kind': kind, 'differs': [_drawn(*d) for d in differs],
        'shared': [[e.at.name, e.at.joint] for e in both[len(differs) if kind == SIZE else 0 :]],
    }  # fmt: skip
    answer_file.write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')


def _sized(rng, world, motion, names):
    effect = draw_effect(rng, str(rng.choice(names)), world.bodies, motion, True)  # noqa: FBT003
    sizes.sized(world, effect, math.exp(rng.uniform(math.log(0.02), math.log(0.1))))
    return effect


def _drawn(machine, simulation):
    """Return effect, joint, and by how much its size is greater on the machine."""
    at = (machine or simulation).at
    name, sides = _SIZES[at.name], ((machine, 1.0), (simulation, -1.0))
    size = sum(sign * e.at.parameters[name] for e, sign in sides if e)
    return {'effect': at.name, 'joint': at.joint, name: size}


def scored(row, diagnosis):
    """Return the answer of one world with its score."""
    if 'refused' in diagnosis:
        row |= {'said': 'refused', 'why': diagnosis['refused'], 'outcome': 'missed'}
        row['shared_named'] = 0
    else:
        row |= judged(row, diagnosis)
    print(row['case'], row['robot'], row['differs'], '->', row['said'], row['outcome'],
          f'shared {row["shared_named"]} of {len(row["shared"])}, {row["seconds"]:.0f} s',
          flush=True)  # fmt: skip
    return row


def judged(answer, diagnosis):
    """Return what is said of a world, and whether it is `right`, `missed` or `wrong`."""
    found = [*diagnosis['setup'], *diagnosis['findings']]
    found = [f for f in found if f['probability'] > 0.5]
    wanted = answer['differs']
    others = [f for f in found if not any(_is_there(w, f) for w in wanted)]
    exact = all(any(_is(w, f) for f in found) for w in wanted)
    calm = bool(wanted) or diagnosis['verdict'] == 'no_mismatch'
    outcome = 'wrong' if others else 'right' if exact and calm else 'missed'
    shared = {(f['effect'], f['joint']) for f in diagnosis.get('shared', [])}
    return {
        'said': [
            diagnosis['verdict'], *([f['effect'], f['joint'], _difference(f)] for f in found)
        ],
        'outcome': outcome, 'shared_named': sum(tuple(s) in shared for s in answer['shared']),
    }  # fmt: skip


def _is_there(wanted, found):
    return (wanted['effect'], wanted['joint']) == (found['effect'], found['joint'])


def _difference(found):
    """Return value and standard deviation of the size that differs, where it is said."""
    said = (found.get('difference') or {}).get(_SIZES.get(found['effect']), {})
    return [said.get('value'), said.get('std')]


def _is(wanted, found):
    """Return whether a difference is named with its joint and size."""
    if not _is_there(wanted, found):
        return False
    value, std = _difference(found)
    true = wanted[_SIZES[wanted['effect']]]
    return value is not None and abs(value - true) <= max(_CLOSE * abs(true), _STD * (std or 0.0))


def summary(rows):
    """Return how many cases are right, by what differs, and what is shared and named so."""
    outcomes = ('right', 'missed', 'wrong')
    count = lambda group: {o: sum(r['outcome'] == o for r in group) for o in outcomes}  # noqa: E731
    by_kind = {k: count([r for r in rows if r['kind'] == k]) for k in sorted(set(PLAN))}
    shared = [sum(r['shared_named'] for r in rows), sum(len(r['shared']) for r in rows)]
    return {'worlds': len(rows), **count(rows), 'by_kind': by_kind, 'shared_named': shared}


if __name__ == '__main__':
    main()
