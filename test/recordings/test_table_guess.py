"""Tables without a map: what names and numbers tell, and what is said to be unsure."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from scipy.io import savemat

from sgp_ros.cli import main
from sgp_ros.engine.samples import EFFORT, POSITION, VELOCITY, CommandSample, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import meaning
from sgp_ros.recordings.imports import import_table
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_entries import JointHint
from sgp_ros.recordings.table_units import position_unit

T = np.arange(200) * 0.005
Q = np.column_stack([np.sin(3.0 * T), 0.5 * np.cos(2.0 * T)])
DQ = np.column_stack([3.0 * np.cos(3.0 * T), -np.sin(2.0 * T)])
LATE_S = 1e-4 * np.random.default_rng(3).uniform(1.0, 30.0, 200)
TAU = np.column_stack([np.cos(T), np.sin(5.0 * T)])
LATE = np.column_stack([np.sin(3.0 * T + 0.1), 0.5 * np.cos(2.0 * T + 0.1)])
HINTS = (JointHint('shoulder', lower=-2.0, upper=2.0), JointHint('elbow', lower=-2.0, upper=2.0))


def _npz(folder, **arrays):
    np.savez(folder / 'log.npz', **arrays)
    return folder / 'log.npz'


def _read(path, folder, hints=HINTS, rate=None):
    """Return the summary, the states and the commands that were written."""
    summary = import_table(path, None, folder / 'out', hints, rate)
    events = list(open_recording(summary.path).events())
    states = [e for e in events if isinstance(e, JointSample)]
    return summary, states, [e for e in events if isinstance(e, CommandSample)]


@pytest.mark.parametrize(
    ('name', 'role', 'is_target', 'joint', 'unit'),
    [
        ('t', 'time', False, '', ''),
        ('time_ms', 'time', False, '', 'ms'),
        ('/joint_states/elbow/position', 'position', False, 'elbow', ''),
        ('q_des_2', 'position', True, '2', ''),
        ('tau_J_d', 'effort', True, '', ''),
        ('dq_rad_s', 'velocity', False, '', 'rad/s'),
        ('pos_deg_j2', 'position', False, '2', 'deg'),
        ('tau_des_Nm', 'effort', True, '', 'N m'),
        ('joint1_current_mA', 'current', False, '1', 'mA'),
        ('observation.state', 'state', False, '', ''),
        ('action', 'command', True, '', ''),
        ('ts', 'time', False, '', ''),
        ('target_velocity', 'velocity', True, '', ''),
        ('p_gain', 'kp', False, '', ''),
        ('knee.eff', 'effort', False, 'knee', ''),
        ('ddq', 'other', False, '', ''),
        ('alpha_pend', 'position', False, 'pend', ''),
        ('phi_dot_arm', 'velocity', False, 'arm', ''),
        ('M_boom [Nm]', 'effort', False, 'boom', 'N m'),
        ('boom_m', '', False, 'boom', 'm'),
        ('moment_mNm', 'effort', False, '', 'mN m'),
        ('boom.torque [kN m]', 'effort', False, 'boom', 'kN m'),
        ('j4.ActVel_degps', 'velocity', False, '4', 'deg/s'),
        ('base_pan_load_pct', 'effort', False, 'base_pan', '%'),
        ('Load [%]', 'effort', False, '', '%'),
        ('load', 'effort', False, '', '%'),
        ('lift_pwm', 'duty', False, 'lift', ''),
        ('Present_PWM', 'duty', False, 'Present', ''),
        ('wheel_rpm', '', False, 'wheel', 'rpm'),
        ('load_torque', 'effort', False, '', ''),
        ('A1_Moment_Prozent', 'effort', False, 'A_1', '%'),
        ('torque_permille', 'effort', False, '', '‰'),
        ('Moment [‰]', 'effort', False, '', '‰'),
        ('cur_lift', 'current', False, 'lift', ''),
        ('pan.iq_mA', 'current', False, 'pan', 'mA'),
        ('pan.speed_dps', 'velocity', False, 'pan', 'deg/s'),
        ('current_pos_lift', 'position', False, 'lift', ''),
        ('goal_position', 'position', True, '', ''),
        ('ax1_actcur_A', 'current', False, 'ax_1', 'A'),
        ('ax1_actpos_deg', 'position', False, 'ax_1', 'deg'),
        ('lift_poscmd', 'position', True, 'lift', ''),
        ('posture', '', False, 'posture', ''),
        ('ang_boom', 'position', False, 'boom', ''),
        ('F_trolley [N]', 'effort', False, 'trolley', 'N'),
        ('flap_rate_deg_s', 'velocity', False, 'flap', 'deg/s'),
        ('joint_a', '', False, 'a', ''),
        ('jpos.1', 'position', False, '1', ''),
        ('AIPos.A1', 'position', False, 'AI_A_1', ''),
        ('motorState[0].tauEst', 'effort', False, '0', ''),
        ('jacket', '', False, 'jacket', ''),
        ('state.time [s]', 'time', False, '', 's'),
    ],
)
def test_names_tell_quantity_joint_and_unit(name, role, is_target, joint, unit):
    said = meaning(name)
    assert (said.role, said.is_target, said.joint, said.unit) == (role, is_target, joint, unit)


def test_lists_in_round_brackets_beside_names_are_read(tmp_path):
    """As Python prints the tuples of a message."""
    rows = [
        f'{t},"[\'elbow\', \'shoulder\']","{tuple(map(float, q[::-1]))}"'
        for t, q in zip(T, Q, strict=True)
    ]
    (tmp_path / 'log.csv').write_text('\n'.join(['Time,name,position', *rows]))
    _, states, _ = _read(tmp_path / 'log.csv', tmp_path)
    assert states[0].names == ('elbow', 'shoulder')
    np.testing.assert_allclose([s.position for s in states], Q[:, ::-1])


def test_x_is_the_position_of_a_joint_that_slides(tmp_path):
    path = _npz(tmp_path, t=T, x=Q[:, 0], dx=DQ[:, 0], x_ref=LATE[:, 0], F=TAU[:, 0])
    summary, states, commands = _read(path, tmp_path, (JointHint('carriage', slides=True),))
    assert 'x is taken as the position of a joint that slides.' in summary.unsure
    np.testing.assert_allclose([s.position[0] for s in states], Q[:, 0])
    np.testing.assert_allclose([s.velocity[0] for s in states], DQ[:, 0])
    np.testing.assert_allclose([s.effort[0] for s in states], TAU[:, 0])
    np.testing.assert_allclose([c.effort[0] for c in commands], LATE[:, 0])
    with pytest.raises(RecordingError, match='no column of positions'):
        _read(path, tmp_path, (JointHint('arm'),))


def test_what_no_name_says_belongs_to_the_joint_that_is_left(tmp_path):
    """A cart and its pole: `x` slides, and `F` is that of the only motor."""
    columns = {
        't [s]': T,
        'phi [deg]': np.degrees(Q[:, 1]),
        'x [mm]': 1e3 * Q[:, 0],
        'F': TAU[:, 0],
    }
    hints = (JointHint('pole', is_driven=False), JointHint('rail', slides=True))
    summary, states, _ = _read(_npz(tmp_path, **columns), tmp_path, hints)
    assert any('phi [deg] is taken as the position of pole' in said for said in summary.unsure)
    rail, pole = (states[0].names.index(name) for name in ('rail', 'pole'))
    np.testing.assert_allclose([s.position[rail] for s in states], Q[:, 0])
    np.testing.assert_allclose([s.position[pole] for s in states], Q[:, 1])
    np.testing.assert_allclose([s.effort[rail] for s in states], TAU[:, 0])
    assert summary.quality['missing'] == {'position': 0, 'effort': 0}


def test_columns_with_the_numbers_of_the_joints_are_theirs(tmp_path):
    """In whatever order the robot file names them."""
    hints = (JointHint('axis_2'), JointHint('axis_1'))
    columns = {'t': T, 'A1.Pos_rad': Q[:, 0], 'A2.Pos_rad': Q[:, 1]}
    summary, states, _ = _read(_npz(tmp_path, **columns), tmp_path, hints)
    assert any('by their numbers' in said for said in summary.unsure)
    np.testing.assert_allclose([s.position[s.names.index('axis_1')] for s in states], Q[:, 0])


def test_the_motor_of_a_joint_that_turns_is_no_length(tmp_path):
    path = _npz(tmp_path, t=T, theta_m=Q[:, 0], theta_m_des=LATE[:, 0])
    _, states, _ = _read(path, tmp_path, (JointHint('elbow'),))
    np.testing.assert_allclose([s.position[0] for s in states], Q[:, 0])
    content = yaml.safe_load((tmp_path / 'out' / 'log_map.yaml').read_text())
    assert content['joints']['elbow']['position']['unit'] == 'rad'


def test_joints_of_another_driver_are_those_of_the_robot_with_their_numbers(tmp_path):
    hints = (JointHint('lab_joint1'), JointHint('lab_joint2'))
    names = np.array(['fer_joint2', 'fer_joint1'])
    summary, states, _ = _read(_npz(tmp_path, t=T, q=Q, joint_names=names), tmp_path, hints)
    assert any('fer_joint1 is lab_joint1' in said for said in summary.unsure)
    assert states[0].names == ('lab_joint1', 'lab_joint2')
    np.testing.assert_allclose([s.position for s in states], Q[:, ::-1])


def test_one_of_the_parts_of_three_dimensional_arrays_is_chosen(tmp_path):
    def parts(x):
        return np.stack([x[:100], 2.0 * x[100:]])

    path = _npz(tmp_path, measured_angles=parts(Q), measured_velocities=parts(DQ))
    with pytest.raises(RecordingError, match=r'several recordings: 0, 1; .* --group 0'):
        import_table(path, None, tmp_path, HINTS, 200.0)
    summary = import_table(path, None, tmp_path / 'one', HINTS, 200.0, group='1')
    first = next(iter(open_recording(summary.path).events()))
    np.testing.assert_allclose(first.position, 2.0 * Q[100])


def test_a_log_of_position_control_is_read_with_its_gains(tmp_path):
    """q, dq, q_des, kp, kd of a user, without any map."""
    path = _npz(tmp_path, time=T, q=Q, dq=DQ, q_des=LATE, kp=[30.0, 20.0], kd=2.0)
    summary, states, commands = _read(path, tmp_path)
    assert summary.joints == ('shoulder', 'elbow')
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.velocity for s in states], DQ)
    assert all(s.effort is None for s in states)
    assert {c.kind for c in commands} == {POSITION}
    np.testing.assert_allclose([c.effort for c in commands], LATE)
    gains = yaml.safe_load(summary.gains_path.read_text())
    assert gains == {
        'kp': {'shoulder': 30.0, 'elbow': 20.0},
        'kd': {'shoulder': 2.0, 'elbow': 2.0},
    }
    assert any('order of the robot' in said for said in summary.unsure)
    again = import_table(path, summary.map_path, tmp_path / 'again')
    assert (again.samples, again.commands, again.unsure) == (200, 200, ())
    assert again.gains_path.read_text() == summary.gains_path.read_text()


def test_columns_of_each_joint_are_gathered(tmp_path):
    """In any order, with the joint before or behind; degrees are recognised by the ranges."""
    degrees = np.degrees(Q)
    table = np.column_stack([1e3 * T, degrees[:, 1], degrees[:, 0], np.degrees(DQ[:, ::-1]), TAU])
    header = 'time,elbow_pos,shoulder_pos,elbow_vel,shoulder_vel,torque_shoulder,torque_elbow'
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header=header, comments='')
    summary, states, commands = _read(tmp_path / 'log.csv', tmp_path)
    order = [states[0].names.index(j) for j in ('shoulder', 'elbow')]
    np.testing.assert_allclose([s.position[order] for s in states], Q, atol=1e-12)
    np.testing.assert_allclose([s.velocity[order] for s in states], DQ, atol=1e-12)
    np.testing.assert_allclose([s.effort[order] for s in states], TAU, atol=1e-12)
    assert commands == []
    assert summary.end_ns - summary.start_ns == 995_000_000
    assert 'ms' in ' '.join(summary.unsure) or summary.quality['rate_hz'] == pytest.approx(200.0)


@pytest.mark.parametrize(
    'names', [('arm_shoulder', 'arm_elbow'), ('j1_lift', 'J2'), ('arm', 'arm_2')]
)
def test_columns_that_hold_the_names_of_joints_are_theirs_in_any_order(tmp_path, names):
    """Also where all names begin alike, where a filler is part of one, or one of another."""
    header = f'time,{names[1]}.position,{names[0]}.position'
    np.savetxt(
        tmp_path / 'log.csv', np.column_stack([T, Q[:, ::-1]]), delimiter=',', header=header,
        comments='',
    )  # fmt: skip
    hints = tuple(replace(hint, name=name) for hint, name in zip(HINTS, names, strict=True))
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path, hints)
    order = [states[0].names.index(name) for name in names]
    np.testing.assert_allclose([s.position[order] for s in states], Q, atol=1e-12)
    assert not any('order of the robot' in said for said in summary.unsure)


def test_an_angle_beside_a_greek_one_of_the_same_joint_may_be_its_acceleration(tmp_path):
    """`theta`, `omega`, `alpha` of a textbook: the position is the first, and that is said."""
    table = np.column_stack([T, Q[:, 0], np.gradient(Q[:, 0], T), 50.0 * Q[:, 0], TAU[:, 0]])
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header='t,theta,omega,alpha,tau',
               comments='')  # fmt: skip
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path, HINTS[:1])
    np.testing.assert_allclose([s.position[0] for s in states], Q[:, 0], atol=1e-12)
    assert any('not from alpha' in said for said in summary.unsure)


@pytest.mark.parametrize('names', [('U', 'T'), ('joint_u', 'joint_t')])
def test_joints_may_be_called_as_times_and_commands_are(tmp_path, names):
    """`T` and `U` are axes of industrial arms; alone, `T` is a time all the same."""
    hints = tuple(replace(hint, name=name) for hint, name in zip(HINTS, names, strict=True))
    table = np.column_stack([T, np.degrees(Q), TAU])
    header = 'T,U_act_deg,T_act_deg,U_cur_A,T_cur_A'
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header=header, comments='')
    _, states, commands = _read(tmp_path / 'log.csv', tmp_path, hints)
    order = [states[0].names.index(name) for name in names]
    np.testing.assert_allclose([s.position[order] for s in states], Q, atol=1e-12)
    np.testing.assert_allclose([s.effort[order] for s in states], TAU, atol=1e-12)
    assert not commands


def test_columns_of_joints_that_the_robot_lacks_are_left_out(tmp_path):
    """A robot file of one arm, a table of both: it is said in one line."""
    other = {f'right_{x}_{k}': 9.0 * T for x in ('shoulder', 'elbow') for k in ('pos', 'vel')}
    own = {f'left_{x}_{k}': a[:, i] for k, a in (('pos', Q), ('vel', DQ), ('tau', TAU))
           for i, x in enumerate(('shoulder', 'elbow'))}  # fmt: skip
    hints = [replace(h, name=f'left_{h.name}') for h in HINTS]
    path = _npz(tmp_path, t=T, **other, **own)
    summary, states, _ = _read(path, tmp_path, hints)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    (said,) = summary.unsure
    assert said == 'The robot has no joint of right_shoulder_pos, right_elbow_pos: ignored.'
    with pytest.raises(RecordingError, match='positions of 4 joints'):
        _read(path, tmp_path, (*HINTS, JointHint('knee')))


def test_what_a_program_a_tool_and_a_gripper_do_is_not_of_the_joints_of_an_arm(tmp_path):
    """Beside numbered joints; a state of its own is a position where no name says more."""
    arm = {f'actual_{k}_{i}': a[:, i] for k, a in (('q', Q), ('qd', DQ), ('current', TAU))
           for i in range(2)}  # fmt: skip
    tool = {f'actual_TCP_force_{i}': 9.0 * T for i in range(6)}
    path = _npz(tmp_path, timestamp=T, **tool, **arm, runtime_state=2.0 + 0.0 * T,
                gripper_pos=0.1 * T)  # fmt: skip
    summary, states, _ = _read(path, tmp_path)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    assert not any('runtime_state' in said for said in summary.unsure)
    assert 'The robot has no joint of gripper_pos: ignored.' in summary.unsure
    unknown, _, _ = _read(_npz(tmp_path, timestamp=T, **arm, runtime_state=2.0 + 0.0 * T),
                          tmp_path, ())  # fmt: skip
    assert unknown.joints == ('joint_1', 'joint_2')


def test_a_joint_without_a_column_is_said_and_its_force_is_not_that_of_another(tmp_path):
    """Of a crane whose trolley is not recognised the sway has no motor, nor has it a force."""
    path = _npz(tmp_path, t=T, elbow_pos=Q[:, 1], rail=Q[:, 0], F_motor=TAU[:, 0])
    summary, states, _ = _read(path, tmp_path, (HINTS[0], replace(HINTS[1], is_driven=False)))
    assert states[0].effort is None or not np.isfinite(states[0].effort).any()
    said = ' '.join(summary.unsure)
    assert 'No column of positions was recognised for shoulder: enter it in the map.' in said
    assert 'F_motor belongs to no position' in said


@pytest.mark.parametrize('unit', ['A', 'mA'])
def test_a_unit_of_currents_says_what_a_column_holds(tmp_path, unit):
    """`motor_mA` is what the only motor draws."""
    table = np.column_stack([T, Q[:, 0], TAU[:, 0]])
    header = f'time,flap_angle,drive_{unit}'
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header=header, comments='')
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path, (JointHint('flap'),))
    assert all(np.isfinite(s.effort).all() for s in states)
    assert any(f'The efforts are in {unit}' in x for x in summary.unsure)


@pytest.mark.parametrize('is_driven', [False, True])
def test_what_a_motor_does_belongs_to_the_only_joint_that_has_one(tmp_path, is_driven):
    """Of a pendulum on a driven arm `motor_torque` names no joint, and need not."""
    path = _npz(tmp_path, t=T, shoulder_pos=Q[:, 0], elbow_pos=Q[:, 1], motor_torque=TAU[:, 0])
    hints = (HINTS[0], replace(HINTS[1], is_driven=is_driven))
    summary, states, _ = _read(path, tmp_path, hints)
    at = states[0].names.index('shoulder')
    efforts = [] if states[0].effort is None else [s.effort[at] for s in states]
    has_torque = bool(efforts) and bool(np.isfinite(efforts).all())
    assert has_torque is not is_driven
    assert any('motor_torque belongs to no position' in x for x in summary.unsure) is is_driven


@pytest.mark.parametrize(
    ('header', 'said'),
    [
        ('Time [ms],Angle [deg],Motor torque cmd [Nm]', ''),
        ('time_ms,elbow_deg,motor_torque_cmd', ''),
        ('time_ms,elbow_deg,drive_torque_cmd', 'drive_torque_cmd is taken as that of elbow'),
    ],
)
def test_the_torque_of_a_single_joint_is_its_own_whatever_it_is_called(tmp_path, header, said):
    """As a user names the columns of one pendulum; a name of something else is reported."""
    table = np.column_stack([1e3 * T, np.degrees(Q[:, 0]), TAU[:, 0]])
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header=header, comments='')
    summary, _, commands = _read(tmp_path / 'log.csv', tmp_path, (JointHint('elbow'),))
    np.testing.assert_allclose([c.effort[0] for c in commands], TAU[:, 0])
    assert ('is taken as' in ' '.join(summary.unsure)) == bool(said)
    assert said in ' '.join(summary.unsure)


@pytest.mark.parametrize(
    ('header', 'units'),
    [('time,shoulder,elbow', 's,deg,deg'), ('time,shoulder_pos,elbow_pos', '(s),(deg),[deg]')],
)
def test_units_in_a_line_below_the_names_are_those_of_the_columns(tmp_path, header, units):
    """Degrees of a joint that turns without end cannot be told from radians by their range."""
    rows = [','.join(map(repr, row)) for row in np.column_stack([T, np.degrees(Q)]).tolist()]
    (tmp_path / 'log.csv').write_text('\n'.join([header, units, *rows]))
    endless = (JointHint('shoulder'), JointHint('elbow'))
    _, states, _ = _read(tmp_path / 'log.csv', tmp_path, endless)
    np.testing.assert_allclose([s.position for s in states], Q, atol=1e-12)


def test_units_of_the_columns_of_a_matrix_may_be_listed(tmp_path):
    """In an attribute, one for each column, of arrays that are named alike."""
    with h5py.File(tmp_path / 'log.h5', 'w') as log:
        log['time_us'] = np.round(1e6 * T)
        for name, x in (('actual_position', Q), ('set_position', LATE)):
            log[name] = x * [np.degrees(1.0), 1e3]
            log[name].attrs['unit'] = 'deg mm'
        log['joint_force'] = TAU
        log['joint_force'].attrs['unit'] = 'Nm kN'
    hints = (JointHint('shoulder'), replace(HINTS[1], slides=True))
    _, states, commands = _read(tmp_path / 'log.h5', tmp_path, hints)
    np.testing.assert_allclose([s.position for s in states], Q, atol=1e-12)
    np.testing.assert_allclose([s.effort for s in states], TAU * [1.0, 1e3], atol=1e-12)
    np.testing.assert_allclose([c.effort for c in commands], LATE, atol=1e-12)


def test_targets_have_their_own_unit(tmp_path):
    """Set angles in degrees beside measured ones in radians."""
    path = _npz(tmp_path, t=T, q=Q, q_des_deg=np.degrees(LATE), tau=TAU)
    _, _, commands = _read(path, tmp_path)
    np.testing.assert_allclose([c.effort for c in commands], LATE, atol=1e-12)


FAR = np.column_stack([1.5 * np.cos(3.0 * T), 1.0 + 0.5 * np.cos(2.0 * T)])
FAR_RATE = np.column_stack([-4.5 * np.sin(3.0 * T), -np.sin(2.0 * T)])


@pytest.mark.parametrize('turn', [2.0 * np.pi, 360.0])
@pytest.mark.parametrize('has_velocity', [True, False])
def test_angles_that_wrap_are_counted_on_within_the_limits(tmp_path, turn, has_velocity):
    """The second joint reads one turn too much throughout; the targets wrap elsewhere."""
    factor = turn / (2.0 * np.pi)
    q, target = (factor * FAR) % turn, (factor * (FAR + 0.01) + 0.3 * turn) % turn - 0.3 * turn
    hints = (HINTS[0], JointHint('elbow', lower=-5.6, upper=-4.7))
    rates = {'dq': factor * FAR_RATE} if has_velocity else {}
    path = _npz(tmp_path, t=T, q=q, q_des=target, kp=1.0, kd=1.0, **rates)
    summary, states, commands = _read(path, tmp_path, hints)
    expected = FAR - [0.0, 2.0 * np.pi]
    np.testing.assert_allclose([s.position for s in states], expected, atol=1e-9)
    np.testing.assert_allclose([c.effort for c in commands], expected + 0.01, atol=1e-9)
    assert 'angles of shoulder, elbow wrap' in ' '.join(summary.remarks)
    if has_velocity:
        np.testing.assert_allclose([s.velocity for s in states], FAR_RATE)
        assert 'velocity' not in ' '.join(summary.unsure)


def test_an_angle_without_limits_that_wraps_begins_within_half_a_turn(tmp_path):
    """One that does not wrap stays."""
    angle = np.column_stack([3.5 + 5.0 * T, 4.0 + T])
    path = _npz(tmp_path, t=T, q_rad=angle % (2.0 * np.pi))
    _, states, _ = _read(path, tmp_path, [])
    np.testing.assert_allclose([s.position for s in states], angle - [2.0 * np.pi, 0.0])


def test_a_step_of_a_turn_that_is_no_wrap_stays(tmp_path):
    """The steps beside it and the velocity say that it is another motion."""
    angle = np.where(np.arange(200) < 100, 0.1 + T, 4.5 + T)
    path = _npz(tmp_path, t=T, q_rad=angle, dq_rad_s=np.ones(200))
    _, states, _ = _read(path, tmp_path, [])
    np.testing.assert_array_equal([s.position[0] for s in states], angle)


def test_degrees_out_of_the_limits_are_not_said_to_fit_in_degrees(tmp_path):
    path = _npz(tmp_path, t=T, q_deg=200.0 + 20.0 * Q)
    with pytest.raises(RecordingError, match=r'go from 200 to 220 deg; expected its limits, -57'):
        _read(path, tmp_path, [replace(h, lower=-1.0, upper=1.0) for h in HINTS])


def test_a_slide_that_fits_its_range_only_in_millimetres_is_in_these(tmp_path):
    """It is said, as degrees of a joint are that goes beyond one turn."""
    path = _npz(tmp_path, t=T, q=Q * [1.0, 1e3], tau=TAU)
    hints = (HINTS[0], replace(HINTS[1], slides=True))
    summary, states, _ = _read(path, tmp_path, hints)
    np.testing.assert_allclose([s.position for s in states], Q, atol=1e-12)
    assert 'elbow is assumed to be in mm' in ' '.join(summary.unsure)


def test_a_trace_with_german_words_is_read(tmp_path):
    """Semicolons, decimal commas; joints by their numbers, currents without their factor."""
    header = (
        'Zeit [ms];A1 Soll [Grad];A2 Soll [Grad];A1 Ist [Grad];A2 Ist [Grad];A1 Strom [A];'
        'A2 Strom [A]'
    )
    table = np.column_stack([1e3 * T, np.degrees(LATE), np.degrees(Q), TAU])
    rows = [';'.join(map(repr, row)).replace('.', ',') for row in table.tolist()]
    (tmp_path / 'log.csv').write_text('\n'.join([header, *rows]))
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path)
    np.testing.assert_allclose([s.position for s in states], Q, atol=1e-12)
    np.testing.assert_allclose([s.effort for s in states], TAU, atol=1e-12)
    assert 'torque of 1 A' in ' '.join(summary.unsure)


@pytest.mark.parametrize(
    ('name', 'unit'),
    [('load_pct', '%'), ('torque_permille', '‰'), ('torque_counts', 'counts')],
)
def test_an_effort_in_another_unit_asks_for_the_torque_of_one(tmp_path, name, unit):
    """As servos and drives report it; the number goes into the map."""
    path = _npz(tmp_path, t=T, q=Q, **{name: 100.0 * TAU})
    summary, states, _ = _read(path, tmp_path)
    assert any(f'torque of 1 {unit} in' in said for said in summary.unsure)
    np.testing.assert_allclose([s.effort for s in states], 100.0 * TAU)


def test_the_factor_of_a_current_is_per_ampere_in_ma_too(tmp_path):
    """As torque constants are stated; the log of a drive counts milliamperes."""
    path = _npz(tmp_path, t=T, q=Q, iq_mA=1e3 * TAU)
    summary, states, _ = _read(path, tmp_path)
    assert any('torque of 1 A in' in said for said in summary.unsure)
    np.testing.assert_allclose([s.effort for s in states], TAU)


def _bench(q):
    keys = ('timestamp', 'position', 'speed', 'load')
    rows = np.column_stack([T, q, DQ[:, 0], TAU[:, 0]]).tolist()
    return [dict(zip(keys, row, strict=True)) for row in rows]


def test_records_below_a_key_are_the_table_and_the_header_is_not(tmp_path):
    """A header gives no gain: its units are not known."""
    path = tmp_path / 'log.json'
    header = {'mass': 0.5, 'kp': 16.0, 'kd': 1.0, 'ends': [0.0, 1.0], 'servo': {'name': 'mx'}}
    path.write_text(json.dumps({**header, 'entries': _bench(Q[:, 0])}))
    summary, states, _ = _read(path, tmp_path, HINTS[:1])
    np.testing.assert_allclose([s.position for s in states], Q[:, :1])
    np.testing.assert_allclose([s.velocity for s in states], DQ[:, :1])
    said = 'list of records entries is read; mass, kp, kd, ends, servo.name not read'
    assert said in ' '.join(summary.remarks)
    assert 'torque of 1 %' in ' '.join(summary.unsure)
    assert summary.gains_path is None


def test_one_of_several_lists_of_records_is_chosen(tmp_path):
    path = tmp_path / 'log.json'
    runs = {'one': _bench(Q[:, 0]), 'two': _bench(Q[:, 1])}
    path.write_text(json.dumps({'mass': 0.5, 'runs': runs}))
    with pytest.raises(RecordingError, match='--group runs_one'):
        _read(path, tmp_path, HINTS[:1])
    summary = import_table(path, None, tmp_path / 'two', HINTS[:1], group='runs_two')
    states = [e for e in open_recording(summary.path).events() if isinstance(e, JointSample)]
    np.testing.assert_allclose([s.position for s in states], Q[:, 1:])


def test_a_table_in_which_no_torque_is_seen_says_so(tmp_path):
    """At the import, not when a diagnosis is refused."""
    path = _npz(tmp_path, time=T, q=Q, bus_voltage_42=TAU)
    assert 'No torque' in ' '.join(_read(path, tmp_path)[0].unsure)


@pytest.mark.parametrize(
    'arrays',
    [{'y': Q, 'u': TAU}, {'y1': Q[:, 0], 'y2': Q[:, 1], 'u1': TAU[:, 0], 'u2': TAU[:, 1]}],
)
def test_input_and_output_are_effort_and_position_where_nothing_else_is(tmp_path, arrays):
    """It is said; beside positions of a better name both stay what they were."""
    summary, states, commands = _read(_npz(tmp_path, t=T, **arrays), tmp_path)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    assert commands == []
    said = ' '.join(summary.unsure)
    assert 'taken as the position' in said
    assert 'taken as the effort of a joint in N m' in said
    summary, states, _ = _read(_npz(tmp_path, t=T, q=2.0 * Q, **arrays), tmp_path)
    np.testing.assert_allclose([s.position for s in states], 2.0 * Q)
    assert states[0].effort is None


def test_a_target_whose_unit_says_nothing_is_one_beside_others(tmp_path):
    """Of a rail in m beside a joint in rad: `m` may be the unit of many things."""
    names = {'rail_position_m': Q[:, 0], 'rail_target_m': LATE[:, 0],
             'swing_position_rad': Q[:, 1], 'swing_target_rad': LATE[:, 1]}  # fmt: skip
    summary, _, commands = _read(_npz(tmp_path, t=T, **names), tmp_path, ())
    assert {c.kind for c in commands} == {POSITION}
    assert {name for c in commands for name in c.names} == {'rail', 'swing'}
    assert any('rail_target_m stays close to the positions' in said for said in summary.unsure)


def test_an_action_is_what_the_positions_say(tmp_path):
    """Near them it is their target; else nothing says what it is, and it is left out."""
    summary, _, commands = _read(_npz(tmp_path, t=T, q=Q, action=LATE), tmp_path)
    assert {c.kind for c in commands} == {POSITION}
    assert any('taken as position targets' in said for said in summary.unsure)
    summary, _, commands = _read(_npz(tmp_path, t=T, q=Q, tau=TAU, action=9.0 * TAU), tmp_path)
    assert commands == []
    assert any('action commands something' in said for said in summary.unsure)


def test_an_action_that_is_all_there_is_of_efforts_is_one(tmp_path):
    """Unless velocities follow it."""
    summary, _, commands = _read(_npz(tmp_path, t=T, q=Q, action=9.0 * TAU), tmp_path)
    np.testing.assert_allclose([c.effort for c in commands], 9.0 * TAU)
    assert {c.kind for c in commands} == {EFFORT}
    assert any('taken as commanded efforts' in said for said in summary.unsure)
    summary, _, commands = _read(_npz(tmp_path, t=T, q=Q, action=DQ), tmp_path)
    assert {c.kind for c in commands} == {VELOCITY}


def test_a_duty_cycle_stands_for_an_effort_where_there_is_none(tmp_path):
    """Its scale has to be entered; measured torques or currents are preferred."""
    summary, states, _ = _read(_npz(tmp_path, t=T, q=Q, pwm=TAU), tmp_path)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    assert any('torque of 1 %' in said for said in summary.unsure)
    _, states, _ = _read(_npz(tmp_path, t=T, q=Q, pwm=TAU, tau=2.0 * TAU), tmp_path)
    np.testing.assert_allclose([s.effort for s in states], 2.0 * TAU)


def test_a_target_that_is_the_position_is_no_target(tmp_path):
    summary, _, commands = _read(_npz(tmp_path, t=T, q=Q, q_des=Q, tau=TAU), tmp_path)
    assert commands == []
    assert any('equals the measured position' in said for said in summary.unsure)


def test_targets_of_velocity_stay_what_they_are(tmp_path):
    _, _, commands = _read(_npz(tmp_path, t=T, q=Q, dq_cmd=DQ), tmp_path)
    assert {c.kind for c in commands} == {VELOCITY}
    np.testing.assert_allclose([c.effort for c in commands], DQ)


def test_lerobot_columns_have_the_names_of_its_info(tmp_path):
    """Episodes follow each other with a pause; the index of a frame is no time."""
    data = tmp_path / 'data' / 'chunk-000'
    (tmp_path / 'meta').mkdir()
    data.mkdir(parents=True)
    names = ['shoulder.pos', 'elbow.pos']
    features = {key: {'names': names} for key in ('observation.state', 'action')}
    (tmp_path / 'meta' / 'info.json').write_text(json.dumps({'features': features}))
    table = pa.table({
        'observation.state': list(Q), 'action': list(LATE), 'timestamp': np.tile(T[:100], 2),
        'frame_index': np.tile(np.arange(100), 2), 'episode_index': np.repeat([0, 1], 100),
    })  # fmt: skip
    pq.write_table(table, data / 'log.parquet')
    summary, states, commands = _read(data / 'log.parquet', tmp_path, hints=())
    assert summary.joints == ('shoulder', 'elbow')
    assert {c.kind for c in commands} == {POSITION}
    np.testing.assert_allclose([s.position for s in states], Q)
    assert states[100].stamp_ns - states[99].stamp_ns == 10_000_000_000
    assert summary.quality['gaps'] == 1


def test_times_of_parquet_are_those_of_the_states(tmp_path):
    """As a data frame with times writes them: nanoseconds since 1970."""
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * T).astype(np.int64)
    table = pa.table(
        {'timestamp': stamps.astype('datetime64[ns]'), 'q': list(Q), 'tau': list(TAU)}
    )
    pq.write_table(table, tmp_path / 'log.parquet')
    _, states, _ = _read(tmp_path / 'log.parquet', tmp_path)
    assert [s.stamp_ns for s in states] == stamps.tolist()


MESSAGE = """header:
  stamp:
    sec: {0}
    nanosec: {1}
  frame_id: ''
name:
- elbow
- shoulder
position:
- {2}
- {3}
velocity: []
effort:
- {4}
- {5}
"""


def _echoed(q=Q):
    """Return what `ros2 topic echo` prints."""
    return '---\n'.join(
        MESSAGE.format(7, round(1e9 * t), *map(float, (*x[::-1], *u[::-1])))
        for t, x, u in zip(T, q, TAU, strict=True)
    )


def test_messages_that_were_printed_are_a_table(tmp_path):
    """Another text between them, or the end that was cut off, is a row that is ignored."""
    (tmp_path / 'log.yaml').write_text(
        'A message was lost!!!\n\tcount: 1\n---\n' + _echoed()[:-60]
    )
    summary, states, _ = _read(tmp_path / 'log.yaml', tmp_path)
    np.testing.assert_allclose([s.position[::-1] for s in states], Q[:-1])
    np.testing.assert_allclose([s.effort[::-1] for s in states], TAU[:-1])
    assert states[1].stamp_ns - states[0].stamp_ns == 5_000_000
    assert '2 of 201 rows ignored' in ' '.join(summary.remarks)


@pytest.mark.parametrize('is_stamped', [True, False])
def test_the_stamp_of_the_header_is_the_time_unless_nobody_set_it(tmp_path, is_stamped):
    """As `rostopic echo -p` prints it: when a message came, and when it was measured."""
    came, stamp = (np.round(1e9 * (x + 1.5e9)).astype(np.int64) for x in (LATE_S + T, T))
    _, states, _ = _read(_npz(tmp_path, **{
        '%time': came, 'field.header.stamp': stamp * is_stamped, 'field.position0': Q[:, 0],
        'field.effort0': TAU[:, 0],
    }), tmp_path, (JointHint('arm'),))  # fmt: skip
    assert [s.stamp_ns for s in states] == (stamp if is_stamped else came).tolist()


def test_lines_between_the_records_are_rows_without_numbers(tmp_path):
    """A header with more than a record has, and what a log says in between."""
    lines = [{'type': 'meta', 'robot': 'arm', 'joints': ['a', 'b'], 'host': 'lab', 'version': 2}]
    lines += [{'type': 'state', 'ts': t, 'pos': list(q), 'eff': list(u)}
              for t, q, u in zip(T, Q, TAU, strict=True)]  # fmt: skip
    lines.insert(70, {'type': 'log', 'ts': T[69] + 1e-3, 'msg': 'warm'})
    (tmp_path / 'log.jsonl').write_text('\n'.join(map(json.dumps, lines)))
    summary, states, _ = _read(tmp_path / 'log.jsonl', tmp_path)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    assert '2 of 202 rows ignored' in ' '.join(summary.remarks)


def test_one_of_several_recordings_in_a_file_is_chosen(tmp_path):
    """Targets with times of their own are no recording; a map says which columns are meant."""
    path = _npz(tmp_path, **{
        'sim.t': T, 'sim.q': Q, 'sim.tau': TAU, 'real.stamp': T, 'real.pos': 2.0 * Q,
        'real.torque': TAU, 'targets.t': T, 'targets.q_des': Q,
    })  # fmt: skip
    with pytest.raises(RecordingError, match=r'several recordings: sim, real; .* --group sim'):
        _read(path, tmp_path)
    with pytest.raises(RecordingError, match="no group 'rael'"):
        import_table(path, None, tmp_path, HINTS, group='rael')
    for group, factor in (('sim', 1.0), ('real', 2.0)):
        summary = import_table(path, None, tmp_path / group, HINTS, group=group)
        states = [e for e in open_recording(summary.path).events() if isinstance(e, JointSample)]
        np.testing.assert_allclose([s.position for s in states], factor * Q)


def test_names_with_another_last_word_are_recordings_of_one_file(tmp_path):
    """Also with matrices on their sides; what has no such word belongs to each of them."""
    arrays = {'t_train': T[None], 'q_train': Q.T, 'tau_train': TAU.T,
              't_test': T[:150], 'q_test': 2.0 * Q[:150].T, 'tau_test': TAU[:150].T,
              'kp': [3.0, 2.0], 'kd': 1.0}  # fmt: skip
    path = _npz(tmp_path, **arrays)
    with pytest.raises(RecordingError, match=r'several recordings: train, test; .*--group train'):
        _read(path, tmp_path)
    for group, q in (('train', Q), ('test', 2.0 * Q[:150])):
        summary = import_table(path, None, tmp_path / group, HINTS, group=group)
        states = [e for e in open_recording(summary.path).events() if isinstance(e, JointSample)]
        np.testing.assert_allclose([s.position for s in states], q)
        assert yaml.safe_load(summary.gains_path.read_text())['kp']['shoulder'] == 3.0
        again = import_table(path, summary.map_path, tmp_path / 'again', group=group)
        assert again.samples == len(q)


@pytest.mark.parametrize('has_time', [True, False])
def test_a_matrix_with_one_row_a_joint_is_turned(tmp_path, has_time):
    path = _npz(tmp_path, q=Q.T, tau=TAU.T, **({'t': T} if has_time else {}))
    _, states, _ = _read(path, tmp_path, rate=None if has_time else 200.0)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.effort for s in states], TAU)


@pytest.mark.parametrize('hints', [HINTS, ()], ids=['robot', 'no robot'])
@pytest.mark.parametrize('has_accelerations', [True, False])
def test_blocks_of_a_matrix_without_names_are_told_by_their_changes(
    tmp_path, hints, has_accelerations
):
    """It is said. Where a block is no derivative of the one before, the table is refused."""
    more = [-9.0 * Q[:, :1], -4.0 * Q[:, 1:]] if has_accelerations else []
    path = _npz(tmp_path, data=np.column_stack([Q, DQ, *more, TAU]))
    summary, states, _ = _read(path, tmp_path, hints, rate=200.0)
    np.testing.assert_allclose([s.position for s in states], Q)
    np.testing.assert_allclose([s.velocity for s in states], DQ)
    np.testing.assert_allclose([s.effort for s in states], TAU)
    assert '0 to 1 are positions, 2 to 3 are velocities' in ' '.join(summary.unsure)
    width = 8 if has_accelerations else 6
    for matrix, rate in (([Q, DQ, *more, TAU], 100.0), ([Q, TAU, *more, DQ], 200.0)):
        path = _npz(tmp_path, data=np.column_stack(matrix))
        with pytest.raises(RecordingError, match=rf'among \[.data \({width} columns\)'):
            _read(path, tmp_path, hints, rate=rate)


def test_other_yaml_is_no_table(tmp_path):
    (tmp_path / 'robot.yaml').write_text('schema: 1\nurdf: robot.urdf\n')
    with pytest.raises(RecordingError, match='no column of time'):
        _read(tmp_path / 'robot.yaml', tmp_path)


@pytest.mark.parametrize('ending', ['h5', 'mat', 'json', 'jsonl', 'parquet'])
def test_every_format_gives_the_same(tmp_path, ending):
    arrays = {'t': T, 'q': Q, 'dq': DQ, 'tau': TAU}
    path = tmp_path / f'log.{ending}'
    if ending == 'h5':
        with h5py.File(path, 'w') as file:
            for name, x in arrays.items():
                file[f'run/{name}'] = x
    elif ending == 'mat':
        savemat(path, {'run': arrays})
    elif ending == 'json':
        path.write_text(json.dumps({'run': {name: x.tolist() for name, x in arrays.items()}}))
    elif ending == 'jsonl':
        rows = [{name: x[i].tolist() for name, x in arrays.items()} for i in range(len(T))]
        path.write_text('\n'.join(map(json.dumps, rows)))
    else:
        pq.write_table(pa.table({n: list(x) for n, x in arrays.items()}), path)
    _, states, _ = _read(path, tmp_path)
    for wanted, channel in ((Q, 'position'), (DQ, 'velocity'), (TAU, 'effort')):
        np.testing.assert_allclose([getattr(s, channel) for s in states], wanted)


@pytest.mark.parametrize('ending', ['npz', 'h5', 'mat', 'jsonl', 'parquet'])
def test_names_of_joints_in_the_table_tell_the_order_of_its_columns(tmp_path, ending):
    """The list may have any name; one in each row may change its order."""
    path, names = tmp_path / f'log.{ending}', ['elbow', 'shoulder']
    arrays = {'t': T, 'q': Q[:, ::-1], 'tau': TAU[:, ::-1]}
    if ending == 'npz':
        np.savez(path, axis_names=np.array(names), **arrays)
    elif ending == 'mat':
        savemat(path, {'axis_names': np.array(names, dtype=object), **arrays})
    elif ending == 'h5':
        with h5py.File(path, 'w') as file:
            file['axis_names'] = names
            file.update(arrays)
    else:
        turn = [slice(None), slice(None, None, -1)]
        rows = [
            {'t': T[i], 'axis': names[turn[i % 2]], 'q': Q[i, ::-1][turn[i % 2]].tolist(),
             'tau': TAU[i, ::-1][turn[i % 2]].tolist()} for i in range(len(T))
        ]  # fmt: skip
        if ending == 'parquet':
            pq.write_table(pa.Table.from_pylist(rows), path)
        else:
            path.write_text('\n'.join(map(json.dumps, rows)))
    _, states, _ = _read(path, tmp_path)
    order = [states[0].names.index(hint.name) for hint in HINTS]
    np.testing.assert_allclose([s.position[order] for s in states], Q)
    np.testing.assert_allclose([s.effort[order] for s in states], TAU)


@pytest.mark.parametrize(
    ('before', 'parts'), [('header.stamp.', ('secs', 'nsecs')), ('', ('sec', 'nanosec'))]
)
def test_the_two_parts_of_a_stamp_of_ros_are_one_time(tmp_path, before, parts):
    """As tools write JointState messages, to the nanosecond."""
    stamps = 1_731_400_000_900_000_001 + np.arange(len(T)) * 5_000_000
    header = ','.join([*(before + part for part in parts), 'shoulder_pos', 'elbow_pos'])
    rows = [f'{s // 10**9},{s % 10**9},{a},{b}' for s, (a, b) in zip(stamps, Q, strict=True)]
    (tmp_path / 'log.csv').write_text('\n'.join([header, *rows]))
    _, states, _ = _read(tmp_path / 'log.csv', tmp_path)
    assert [s.stamp_ns for s in states] == stamps.tolist()


def test_the_attributes_of_a_dataset_tell_its_unit(tmp_path):
    with h5py.File(tmp_path / 'log.h5', 'w') as file:
        file['log/t'] = T
        for name, x, unit in (('actual_pos', np.degrees(Q), 'deg'), ('torque', TAU, 'kN m')):
            for i, joint in enumerate(('shoulder', 'elbow')):
                file[f'log/{joint}/{name}'] = x[:, i]
                file[f'log/{joint}/{name}'].attrs['unit'] = unit
    _, states, _ = _read(tmp_path / 'log.h5', tmp_path)
    order = [states[0].names.index(hint.name) for hint in HINTS]
    np.testing.assert_allclose([s.position[order] for s in states], Q)
    np.testing.assert_allclose([s.effort[order] for s in states], 1e3 * TAU)


def test_a_commanded_effort_beside_targets_without_gains_is_what_drives(tmp_path):
    """With gains, or a measured effort, the targets are kept, as the drives may follow them."""
    asked = {'t [s]': T, 'x [mm]': 1e3 * Q[:, 0], 'x_ref [mm]': 1e3 * LATE[:, 0]}
    force = {'F_cmd [mN]': 1e3 * TAU[:, 0]}
    slide = (JointHint('stage', slides=True),)
    summary, _, commands = _read(_npz(tmp_path, **asked, **force), tmp_path, slide)
    assert {c.kind for c in commands} == {EFFORT}
    np.testing.assert_allclose([c.effort[0] for c in commands], TAU[:, 0])
    assert any('no gains are given' in said for said in summary.unsure)
    path = _npz(tmp_path, **asked, **force, kp=np.array([9.0]), kd=np.array([1.0]))
    assert {c.kind for c in _read(path, tmp_path, slide)[2]} == {POSITION}


def test_commands_of_a_table_keep_their_joints_in_any_order(tmp_path):
    """Numbers without names would be taken in the order of the robot, whatever the columns."""
    asked = {'elbow_cmd_Nm': TAU[:, 1], 'shoulder_cmd_Nm': TAU[:, 0]}
    seen = {'t_s': T, 'elbow_deg': np.degrees(Q[:, 1]), 'shoulder_deg': np.degrees(Q[:, 0])}
    _, _, commands = _read(_npz(tmp_path, **seen, **asked), tmp_path)
    given = dict(zip(commands[7].names, commands[7].effort, strict=True))
    assert given == pytest.approx({'shoulder': TAU[7, 0], 'elbow': TAU[7, 1]})


def test_poses_need_no_clock_where_the_side_of_their_approach_is_told(tmp_path, capsys):
    """Each row is a pose that was approached from one side, as the directions of all joints."""
    side = np.where(np.arange(200) % 2, 1.0, -1.0)
    table = {'q_shoulder': Q[:, 0], 'q_elbow': Q[:, 1], 'tau_shoulder': TAU[:, 0],
             'tau_elbow': TAU[:, 1], 'approach': side}  # fmt: skip
    summary, states, _ = _read(_npz(tmp_path, **table), tmp_path)
    assert summary.has_poses
    assert any('--static' in said for said in summary.unsure)
    np.testing.assert_array_equal([s.velocity for s in states], np.column_stack([side, side]))
    assert main(['import', str(_npz(tmp_path, **table)), '--out', str(tmp_path / 'x')]) == 0
    assert '--static' in capsys.readouterr().out
    with pytest.raises(RecordingError, match='no column of time'):
        _read(_npz(tmp_path, **table | {'approach': 0.5 * side}), tmp_path)
    summary, states, _ = _read(_npz(tmp_path, t=T, **table), tmp_path)  # a motion
    assert not summary.has_poses
    assert states[0].velocity is None


@pytest.mark.parametrize(('moving', 'unit'), [(1.0, 'rad'), (0.05, 'deg')])
def test_one_joint_out_of_its_range_is_no_sign_of_degrees(moving, unit):
    """All others would move within a degree; unless they hardly move in either unit."""
    wave = np.sin(3.0 * T)
    columns = [(moving * wave, -2.0, 2.0), (moving * wave, -1.5, 1.5), (2.5 * wave, -2.0, 2.0)]
    assert position_unit(columns, are_joints_known=True) == (unit, unit == 'deg')
    degrees = [(np.degrees(x), low, high) for x, low, high in columns]
    assert position_unit(degrees, are_joints_known=True)[0] == 'deg'
    columns[2] = (30.0 * wave, -2.0, 2.0)  # the others follow within a degree
    assert position_unit(columns, are_joints_known=True)[0] == 'deg'


@pytest.mark.parametrize('name', ['log.pkl', 'log.zarr', 'log.npy', 'policy.pt'])
def test_what_is_never_read_is_refused_with_the_reason(tmp_path, capsys, name):
    (tmp_path / name).write_bytes(b'x')
    assert main(['import', str(tmp_path / name), '--out', str(tmp_path / 'out')]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert 'save the data with numpy.savez' in said
    assert not (tmp_path / 'out').exists()


def test_faults_of_the_clock_and_missing_numbers_are_counted(tmp_path):
    t, velocity = T.copy(), DQ.copy()
    t[50:] += 1.0
    t[120] = t[118]
    velocity[3:7, 0] = np.nan
    summary = import_table(_npz(tmp_path, t=t, q=Q, dq=velocity), None, tmp_path, HINTS)
    assert summary.quality['gaps'] == 1
    assert summary.quality['backward'] == 1
    assert summary.quality['missing'] == {'position': 0, 'velocity': 4}


def test_what_cannot_be_guessed_is_refused(tmp_path):
    """No time, no position, or other joints than the robot's: one line each."""
    with pytest.raises(RecordingError, match='--rate HZ'):
        import_table(_npz(tmp_path, q=Q), None, tmp_path, HINTS)
    assert import_table(_npz(tmp_path, q=Q), None, tmp_path, HINTS, 200.0).samples == 200
    assert import_table(_npz(tmp_path, q=Q, dt=0.005), None, tmp_path, HINTS).samples == 200
    with pytest.raises(RecordingError, match='no column of positions'):
        import_table(_npz(tmp_path, t=T, x=Q), None, tmp_path, HINTS)
    with pytest.raises(RecordingError, match='positions of 1 joints'):
        import_table(_npz(tmp_path, t=T, q=Q[:, 0]), None, tmp_path, HINTS)


def test_a_log_in_another_language_is_read_by_its_units(tmp_path):
    """As a spreadsheet exports it: titles, degree signs in Windows-1252, commas, a trigger."""
    rows = [
        f'{1e3 * t - 50.0:.1f};{np.degrees(q):.4f};{100.0 * u:.3f};21,5'.replace('.', ',')
        for t, q, u in zip(T, Q[:, 0], TAU[:, 0], strict=True)
    ]
    head = ['Protokoll;Prüfstand;;', 'Zeit [ms];Winkel [°];Drehmoment [Ncm];Temperatur [°C]']
    path = tmp_path / 'log.csv'
    path.write_bytes('\n'.join([*head, *rows]).encode('cp1252'))
    summary, states, _ = _read(path, tmp_path, (JointHint('arm'),))
    assert 'log.csv is not in UTF-8; it is read as Windows-1252' in summary.remarks
    np.testing.assert_allclose([s.position[0] for s in states], Q[:, 0], atol=1e-6)
    np.testing.assert_allclose([s.effort[0] for s in states], TAU[:, 0], atol=1e-5)
    assert np.diff([s.stamp_ns for s in states]).tolist() == [5_000_000] * 199


def test_how_far_an_endless_joint_went_does_not_tell_its_unit(tmp_path):
    """A pole that goes over the top in radians; without a robot, 30 are more likely degrees."""
    far = np.column_stack([T, 30.0 * np.sin(T)])
    np.savetxt(tmp_path / 'log.csv', far, delimiter=',', header='time,pole_pos', comments='')
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path, (JointHint('pole'),))
    np.testing.assert_allclose([s.position[0] for s in states], far[:, 1], atol=1e-12)
    assert any('assumed to be in rad' in said for said in summary.unsure)
    summary, states, _ = _read(tmp_path / 'log.csv', tmp_path, ())
    np.testing.assert_allclose([s.position[0] for s in states], np.radians(far[:, 1]), atol=1e-12)
