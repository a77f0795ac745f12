"""A robot from a URDF: inverse model of a tree of joints with friction and offsets.

A robot YAML with the key `urdf` states which joints move and which physics is assumed:

    schema: 1
    urdf: panda.urdf            # relative to this file; or the XML itself
    name: panda
    joints: [j1, j2]            # joints that move, in this order; all others are locked
    locked: {torso: 0.15}       # position [rad or m]; default 0
    passive: [j3]               # without effort; default: as `ros2_control` states
    effort_gain: {j1: 13.6}     # N m or N per unit of the recorded effort
    payload: {link: tool0, mass: 0.5, com: [0, 0, 0.05]}
    terms: {inertial: all, viscous: all, coulomb: [j1], offset: all}
    coulomb_width: 0.01         # rad/s or m/s, over which dry friction changes its sign
    stribeck_velocity: 0.1      # rad/s or m/s
    prior: {inertial: {spread: 0.3}}   # about the values of the URDF; default: flat
    residual_inputs: own        # or all, or a list such as [velocity:j1]
    effects:                    # physics in addition to the terms, as in a diagnosis
      - {effect: spring, joint: j1, parameters: {stiffness: {value: 2.9, std: 0.1},
                                                 rest: {value: 0.4, std: 0.01}}}

    gains: {kp: {j1: 300.0}, kd: {j1: 10.0}}   # of drives whose commands are positions
    remarks: [...]              # what could not be represented from the model file
    model: arm.xml              # the MJCF that this came from, for `sgp export`
    parameters:                 # values of coefficients, as `sgp identify` writes them
      elbow.coulomb: {value: 0.4, std: 0.01, unit: N m}

Values in `parameters` for a body, or for damping or friction of a joint, replace those of the
URDF; `effects` are added to both. Diagnosis, replay, simulation and the node follow this rule.
`terms` are what is learned. Anything else stays as in the URDF, or is not modelled.

Only `schema` and `urdf` are required. The model predicts efforts. Where accelerations are needed,
as for joints without effort, the engine solves the same equation of motion for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.joint_terms import Shape, joint_term, term_laws
from sgp_ros.physics.term import Joint, Term
from sgp_ros.rigid.inertial import inertial_term
from sgp_ros.rigid.locking import Plan, plan_joints
from sgp_ros.rigid.tree import Payload, Tree, read_urdf
from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.robots.effect_terms import changed_tree, effect_terms, effort_map, rest_friction
from sgp_ros.robots.entries import Entries
from sgp_ros.robots.models.door import find_file
from sgp_ros.robots.nominal_prior import inertial_prior, joint_prior
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import read_effects
from sgp_ros.strangers import read_text

DEFAULT_TERMS: Mapping[str, str] = dict.fromkeys(
    ('inertial', *(name for name, (_, form) in term_laws().items() if form.is_assumed)), 'all'
)


def build_urdf_robot(
    document: Mapping[str, Any], folder: Path, problems: list[str]
) -> Robot | None:
    """Return the robot of a robot YAML with the key `urdf`, `parameters` not yet in its prior.

    Args:
        document: the content of the file.
        folder: that `urdf` is relative to.
        problems: what is wrong is appended here.

    Returns:
        None where the URDF cannot be read as the document asks for.
    """
    entries = Entries(document, problems)
    place = _place(entries.text('urdf', ''), folder)
    tree = _read_tree(entries, place)
    if tree is None:
        return None
    joints = _joints(tree, entries.numbers('effort_gain'), problems)
    effects = read_effects(document.get('effects'), tree, problems)
    width = entries.positive('coulomb_width', Shape().coulomb_width)
    own = _terms(changed_tree(tree, effects), joints, entries)
    terms = (*own, *effect_terms(tree, effects, width))
    names = tree.moving_names
    robot = Robot(
        name=entries.text('name', tree.name),
        joints=joints,
        target='effort',
        terms=terms,
        residual_inputs=tuple((f'position:{name}', f'velocity:{name}') for name in names),
        description=_description(tree, place, effects),
        source={k: v for k, v in document.items() if k not in {'schema', 'urdf'}}
        | {'urdf': str(place.resolve()) if isinstance(place, Path) else place},
        effort_map=effort_map(tree, effects, width),
        rest_friction=rest_friction(tree, effects, width),
    )
    try:
        return robot.with_inputs(document.get('residual_inputs', 'own'))
    except ConfigError as error:
        problems.append(str(error))
        return robot


def nominal_robot(robot: Robot) -> Robot:
    """Return a robot from a URDF with the values of the URDF as the means of its prior.

    Raises:
        ConfigError: the URDF is no longer what it was.
    """
    source = dict(robot.source)
    terms = source.get('terms') or DEFAULT_TERMS
    assert isinstance(terms, dict)
    source |= {'prior': {kind: {'spread': 1.0} for kind in terms}}
    problems: list[str] = []
    nominal = build_urdf_robot(source, Path(), problems)
    if nominal is None or problems:
        raise ConfigError(f'URDF {source["urdf"]}: ' + ' | '.join(problems), 'a valid URDF')
    return nominal


def nominal_tree(robot: Robot) -> Tree:
    """Return the kinematic tree of a robot from a URDF, with the file's inertias and damping.

    Raises:
        ConfigError: the robot has no URDF, or it is no longer what it was.
    """
    if 'urdf' not in robot.source:
        raise ConfigError(
            f'robot {robot.name} has no URDF', 'a .urdf, or a robot YAML with the key urdf'
        )
    problems: list[str] = []
    source = str(robot.source['urdf'])
    tree = _read_tree(Entries(robot.source, problems), _place(source, Path()))
    if tree is None:
        raise ConfigError(f'URDF {source}: ' + ' | '.join(problems), 'a valid URDF')
    return tree


def stated_part(robot: Robot) -> tuple[Plan, Payload | None]:
    """Return which joints of its URDF a robot lets move, and the load that it states."""
    entries = Entries(robot.source, [])
    plan = plan_joints(parse_urdf(urdf_text(robot)), **_joint_entries(entries))
    return plan, _payload(entries)


def term_shape(robot: Robot) -> Shape:
    """Return the settings of the terms of a robot from a URDF."""
    return _shape(Entries(robot.source, []))


def _shape(entries: Entries) -> Shape:
    return Shape(
        entries.positive('coulomb_width', Shape().coulomb_width),
        entries.positive('stribeck_velocity', Shape().stribeck_velocity),
    )


def urdf_text(robot: Robot) -> str:
    """Return the text of the URDF of a robot from one."""
    place = _place(str(robot.source['urdf']), Path())
    return place if isinstance(place, str) else read_text(place)


def _place(urdf: str, folder: Path) -> Path | str:
    """Return the file that the key `urdf` names, or the XML that stands there itself."""
    return urdf if urdf.lstrip().startswith('<') else find_file(urdf, folder)


def _read_tree(entries: Entries, place: Path | str) -> Tree | None:
    payload, joints = _payload(entries), _joint_entries(entries)
    try:
        return read_urdf(place, **joints, payload=payload)
    except ConfigError as error:
        entries.problems.append(str(error))
        return None


def _joint_entries(entries: Entries) -> dict[str, Any]:
    return {
        'joints': entries.names('joints'),
        'locked': entries.numbers('locked'),
        'passive': entries.names('passive'),
    }


def _payload(entries: Entries) -> Payload | None:
    load = entries.mapping('payload')
    if load is None:
        return None
    inner = Entries(load, entries.problems, 'payload.')
    inner.refuse_others({'link', 'mass', 'com', 'inertia'})
    return Payload(
        inner.text('link', ''),
        inner.positive('mass', None),
        inner.vector('com', 3),
        inner.vector('inertia', 6),
    )


def _description(tree: Tree, place: Path | str, effects: Sequence[EffectAt]) -> str:
    file = place.name if isinstance(place, Path) else 'a URDF'
    text = f'Rigid-body tree of {tree.size} joints from {file}'
    for is_online, lead in ((True, 'with'), (False, 'not modelled online:')):
        named = [f'{e.name} of {e.joint}' for e in effects if e.effect.is_online == is_online]
        text += f'; {lead} {", ".join(named)}' if named else ''
    return text


def _joints(tree: Tree, gains: Mapping[str, float], problems: list[str]) -> tuple[Joint, ...]:
    for name, gain in gains.items():
        if name not in tree.moving_names:
            problems.append(f'effort_gain of {name!r}, not one of {list(tree.moving_names)}')
        elif gain == 0.0:
            problems.append(f'effort_gain of {name} is 0')
    return tuple(
        Joint(
            name,
            kind='prismatic' if tree.is_prismatic[i] else 'revolute',
            is_actuated=bool(tree.is_actuated[i]),
            effort_gain=gains.get(name, 1.0),
            lower=float(tree.lower[i]),
            upper=float(tree.upper[i]),
            velocity_limit=float(tree.velocity_limit[i]),
            effort_limit=float(tree.effort_limit[i]),
        )
        for i, name in enumerate(tree.moving_names)
    )


def _terms(tree: Tree, joints: tuple[Joint, ...], entries: Entries) -> list[Term]:
    wanted = entries.mapping('terms') or DEFAULT_TERMS
    spreads = _spreads(entries, wanted)
    shape = _shape(entries)
    terms = []
    for kind, who in wanted.items():
        chosen = _chosen(kind, who, tree, entries.problems)
        if chosen is None:
            continue
        if kind == 'inertial':
            bodies = [i for i, leader in enumerate(tree.follows) if int(leader) in chosen]
            is_all = len(bodies) == len(tree.follows)
            term = inertial_term(tree, bodies=None if is_all else bodies)
            prior = inertial_prior(tree, bodies, term, spreads.get(kind, 1.0))
        else:
            term = joint_term(kind, joints, chosen, shape)
            prior = joint_prior(tree, kind, chosen, term, spreads.get(kind, 1.0))
        terms.append(_informed(term, prior) if kind in spreads else term)
    return terms


def _informed(term: Term, prior: Mapping[str, tuple[float, float]]) -> Term:
    coefficients = tuple(
        replace(c, prior_mean=prior[c.name][0], prior_std=prior[c.name][1])
        for c in term.coefficients
    )
    return replace(term, coefficients=coefficients)


def _spreads(entries: Entries, wanted: Mapping[str, object]) -> dict[str, float]:
    prior = entries.mapping('prior') or {}
    spreads = {}
    for kind, entry in prior.items():
        if kind not in wanted:
            entries.problems.append(f'prior of {kind!r}, which is not among the terms')
        elif not isinstance(entry, dict) or set(entry) != {'spread'}:
            entries.problems.append(f'prior of {kind} is {entry!r}, not {{spread: number}}')
        else:
            inner = Entries(entry, entries.problems, f'prior.{kind}.')
            spreads[str(kind)] = inner.positive('spread', None)
    return spreads


def _chosen(kind: str, who: object, tree: Tree, problems: list[str]) -> list[int] | None:
    """Return the joints a term is for; None where it or they are unknown."""
    known = ['inertial', *term_laws()]
    if kind not in known:
        problems.append(f'term {kind!r} is not one of {known}')
        return None
    names = list(tree.moving_names)
    if who == 'all':
        return list(range(len(names)))
    if not isinstance(who, list) or any(name not in names for name in who):
        problems.append(f'term {kind} for {who!r}, not `all` or a list of some of {names}')
        return None
    if len(set(who)) != len(who):
        problems.append(f'term {kind} names a joint twice: {who}')
        return None
    return [names.index(name) for name in who]
