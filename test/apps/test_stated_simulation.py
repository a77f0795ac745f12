"""`sgp simulate` of robot YAMLs: every effect that one can state on every robot that it can name.

The simulation is written by itself; what it does is compared with what a robot from the same YAML
makes of the simulated motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import yaml

from sgp_ros.apps.simulated_robot import find_robot
from sgp_ros.physics.catalogue import EFFECTS as CATALOGUE
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.registry import LAWS
from sgp_ros.simulation.sensors import Sensors
from test.simulation.trees import arm

PERFECT = Sensors(measures_velocity=True, measures_effort=True)
KNOWN = {'terms': {'inertial': 'all', 'viscous': 'all'}, 'coulomb_width': 1e-9,
         'prior': {'inertial': {'spread': 0.1}, 'viscous': {'spread': 0.1}}}  # fmt: skip
VALUES = {
    'simple_pendulum': {'J': 0.06, 'G': 2.0, 'Fv': 0.01, 'Fc': 0.05, 'offset': 0.01},
    'double_pendulum': {
        'J1': 0.11, 'J12': 0.02, 'J2': 0.03, 'H': 0.03, 'G1': 2.2, 'G2': 1.0, 'Fv1': 0.01,
        'Fv2': 0.01, 'Fc1': 0.05, 'Fc2': 0.05, 'offset1': 0.01, 'offset2': 0.01,
    },
}  # fmt: skip
"""Of built-in robots that have no nominal numbers."""
BUILT_IN = (
    'reaction_wheel', 'reaction_wheel_6', 'toy_pendulum', 'linear_axis', 'simple_pendulum',
    'double_pendulum',
)  # fmt: skip
PARTS = {
    'arm': {},
    'turned': {'joints': ['elbow', 'shoulder'], 'effort_gain': {'elbow': -8.7, 'shoulder': 0.5}},
    'underactuated': {'passive': ['shoulder']},
    'forearm': {'locked': {'shoulder': 0.6}, 'effort_gain': {'elbow': 0.03},
                'payload': {'link': 'tool0', 'mass': 0.3, 'com': [0.0, 0.01, 0.05]}},
}  # fmt: skip
"""Keys of robot YAMLs of an arm."""
EFFECT_VALUES = {
    'viscous_friction': {'b': 0.2},
    'coulomb_friction': {'level': 0.1},
    'stribeck_friction': {'coulomb': 0.1, 'static': 0.2, 'stribeck_velocity': 0.3},
    'quadratic_drag': {'c': 0.1},
    'position_friction': {'amplitude': 0.2, 'lo': -0.1, 'hi': 0.3, 'kind': 'viscous'},
    'limit_friction': {'amplitude': 0.3, 'onset': -0.2, 'side': 'upper'},
    'asymmetric_coulomb': {'level_pos': 0.1, 'level_neg': 0.2},
    'spring': {'stiffness': 0.5, 'rest': 0.2},
    'gravity_tilt': {'roll': 0.1, 'pitch': -0.2},
    'payload': {'mass': 0.2, 'x': 0.05, 'y': 0.01, 'z': 0.1},
    'cogging': {'amplitude': 0.2, 'periods': 3.0, 'phase': 0.5},
    'torque_gain': {'gain': 0.8},
    'dead_zone': {'width': 0.05},
    'saturation': {'limit': 0.5},
    'actuator_lag': {'time_constant': 0.02},
    'command_delay': {'delay': 0.015},
    'backlash': {'gap': 0.01},
    'hysteresis': {'level': 0.1, 'presliding': 0.05},
    'armature': {'inertia': 0.01},
    'joint_coupling': {'kind': 'torque', 'coefficient': 0.2},
    'encoder_eccentricity': {'amplitude': 1e-5, 'periods': 1.0, 'phase': 0.3},
    'velocity_filter_lag': {'time_constant': 0.02},
    'coupled_friction': {'ratio': 1.0, 'coulomb': 0.1, 'viscous': 0.05},
    'friction_drift': {'start': 0.3, 'end': 0.1, 'time_constant': 5.0, 'kind': 'coulomb'},
    'constant_load': {'force': 0.2},
    'tip_force': {'fx': 0.5, 'fy': -0.3, 'fz': 1.0},
    'load_friction': {'level': 0.05, 'mu': 0.1},
    'motor_speed_limit': {'stall_torque': 0.6, 'no_load_speed': 3.0},
    'joint_elasticity': {'stiffness': 2000.0, 'damping': 0.5, 'encoder': 'link'},
    'mount_elasticity': {'frequency': 6.0, 'damping_ratio': 0.05, 'moved_mass': 500.0,
                         'axis': 'x'},
    'end_stop': {'position': 0.1, 'stiffness': 30.0, 'damping': 0.0, 'side': 'lower'},
}  # fmt: skip
"""For an arm with forces of a newton metre. The model of a stop is linear: a damped one would pull
when the joint leaves it."""
FORCE = {'reaction_wheel': 0.01, 'reaction_wheel_6': 0.01, 'linear_axis': 100.0}
"""Forces of other robots in those of the arm."""
MOTOR_SHARE = 0.3
"""Of what a joint with backlash moves while the others are free, the part of the motor."""
OF_MOTORS = {'torque_gain', 'dead_zone', 'saturation', 'actuator_lag', 'command_delay', 'backlash',
             'load_friction', 'motor_speed_limit', 'joint_elasticity'}  # fmt: skip


def written(folder, name):
    """Return the file of a robot of this table."""
    path = folder / f'{name}.yaml'
    if name in BUILT_IN:
        values = {key: {'value': x} for key, x in VALUES.get(name, {}).items()}
        document = {'robot': name, 'parameters': values}
    else:
        document = {'urdf': arm(limit=1.5), **PARTS[name], **KNOWN}
    path.write_text(yaml.safe_dump({'schema': 1, **document}), encoding='utf-8')
    return path


def sized(effect, force):
    """Return the values of an effect on a robot with forces of this size."""
    values = dict(EFFECT_VALUES[effect])
    for quantity in CATALOGUE[effect].stated_quantities(values.get('kind', '')):
        if 'N' in quantity.unit and quantity.name in values:
            values[quantity.name] *= force
    return values


def entry_of(effect, joint, values):
    """Return the entry of an effect in a robot YAML."""
    parameters = {name: {'value': value} for name, value in values.items()}
    return {'effect': effect, 'joint': joint, 'parameters': parameters}


def stated(folder, name, effect):
    """Return the file that states an effect; None where the robot cannot have it."""
    nominal = nominal_model(load_robot(str(written(folder, name))))
    tree = nominal.tree
    joints = [j for i, j in enumerate(tree.moving_names)
              if effect not in OF_MOTORS or tree.is_actuated[i]]  # fmt: skip
    values = sized(effect, FORCE.get(name, 1.0))
    if effect in {'backlash', 'joint_elasticity'} and joints:
        (M,) = mass_matrix(tree, tree.parameters, np.zeros((1, tree.size)))
        index = tree.moving_names.index(joints[-1])
        values['motor_inertia'] = MOTOR_SHARE / float(np.linalg.inv(M)[index, index])
    has_tool = any(frame.name == 'tool0' for frame in tree.frames)
    if CATALOGUE[effect].has_source and len(joints) > 1:
        values['source_joint'] = joints[0]
    is_possible = {
        'joint_coupling': len(joints) > 1 and tree.is_actuated.any(),
        'coupled_friction': len(joints) > 1,
        'limit_friction': bool(np.isfinite(tree.upper[0])),
        'tip_force': has_tool,
    }.get(effect, bool(joints))  # fmt: skip
    if not is_possible:
        return None
    place = {'gravity_tilt': 'base', 'mount_elasticity': 'base', 'tip_force': 'tool'}.get(
        effect, joints[-1:] and joints[-1]
    )
    known = nominal.robot.source.get('effects') or []
    document = {
        'schema': 1,
        **KNOWN,
        **nominal.robot.source,
        'effects': [*known, entry_of(effect, place, values)],
    }
    path = folder / 'stated.yaml'
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    return path


@dataclass
class Simulated:
    """A robot and its simulated motion, both from one YAML."""

    robot: object
    motion: Motion
    recorded: np.ndarray
    is_sliding: np.ndarray

    @classmethod
    def of(cls, path, seconds=0.3):
        found = find_robot(str(path))
        robot = load_robot(str(path))
        recording = simulate(
            make_simulation(found.simulator, effects=found.effects, sensors=PERFECT, seed=4),
            seconds,
        )
        given = np.zeros((len(recording.stamps_ns), len(robot.joints)))
        for column, name in enumerate(recording.command_joints):
            given[:, robot.joint_names.index(name)] = recording.command[:, column]
        given *= [joint.effort_gain for joint in robot.joints]
        v = recording.shown_velocity
        effort = given
        if robot.effort_map is not None:
            effort = robot.effort_map(given, v, is_measured=False)
        motion = Motion(recording.shown_position, v, recording.true_acceleration, effort)
        return cls(robot, motion, recording.effort, np.abs(v) > 1e-3)

    def residual(self):
        """Return what the robot of the YAML leaves of the efforts, (n, k)."""
        W = np.array([c.prior_mean for c in self.robot.coefficients])
        return np.where(
            self.is_sliding, self.motion.effort - self.robot.regressor(self.motion) @ W, 0.0
        )


APPLICABLE = {'arm': 31, 'turned': 31, 'underactuated': 31, 'forearm': 29, 'reaction_wheel': 29,
              'reaction_wheel_6': 29, 'toy_pendulum': 18, 'linear_axis': 27, 'simple_pendulum': 27,
              'double_pendulum': 29}  # fmt: skip
"""Robot to how many effects it can have."""


def test_the_tables_name_every_effect():
    assert set(EFFECT_VALUES) == set(CATALOGUE) == set(LAWS)


@pytest.mark.parametrize(
    'name',
    [x if x in {'arm', 'reaction_wheel'} else pytest.param(x, marks=pytest.mark.long)
     for x in APPLICABLE],
)  # fmt: skip
def test_every_stated_effect_is_simulated_as_its_robot_models_it(tmp_path, name):
    """`M a + h = tau + tau_x` with the numbers of the robot from the same file.

    What a model of one time cannot hold only has to move.
    """
    count = 0
    for effect in EFFECT_VALUES:
        path = stated(tmp_path, name, effect)
        if path is None:
            continue
        count += 1
        simulated = Simulated.of(path)
        assert np.ptp(simulated.motion.position) > 0.01, effect
        if CATALOGUE[effect].is_online and not CATALOGUE[effect].is_late:
            force = (
                np.abs(simulated.motion.effort).max()
                + np.abs(simulated.robot.regressor(simulated.motion)).max()
            )
            np.testing.assert_allclose(
                simulated.residual(), 0.0, atol=1e-7 * force, err_msg=effect
            )
    assert count == APPLICABLE[name]


@pytest.mark.parametrize('name', APPLICABLE)
def test_measured_efforts_are_those_that_act_without_effects(tmp_path, name):
    """In the unit in which the robot takes them."""
    simulated = Simulated.of(written(tmp_path, name))
    gains = [joint.effort_gain for joint in simulated.robot.joints]
    np.testing.assert_allclose(simulated.recorded * gains, simulated.motion.effort, atol=1e-9)


def test_each_payload_is_a_body_of_its_own_and_the_last_tilt_is_the_one(tmp_path):
    """A diagnosis of a robot with a payload may find another one; a tilt is found as a whole."""
    path = written(tmp_path, 'arm')
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    document['effects'] = [
        entry_of('payload', 'elbow', {'mass': 0.3, 'x': 0.0, 'y': 0.0, 'z': 0.2}),
        entry_of('gravity_tilt', 'base', {'roll': -0.2, 'pitch': 0.4}),
        entry_of('payload', 'elbow', {'mass': 0.2, 'x': 0.1, 'y': 0.0, 'z': 0.0}),
        entry_of('gravity_tilt', 'base', {'roll': 0.3, 'pitch': 0.1}),
    ]
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    residual = Simulated.of(path).residual()
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)


def test_a_level_that_a_diagnosis_left_below_zero_is_none(tmp_path):
    """Least squares may leave the weaker direction of dry friction there."""
    path = stated(tmp_path, 'arm', 'asymmetric_coulomb')
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    document['effects'][-1]['parameters']['level_pos'] = {'value': -1e-3}
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    (effect,) = find_robot(str(path)).effects
    assert effect.parameters == {'level_pos': 0.0, 'level_neg': 0.2}
