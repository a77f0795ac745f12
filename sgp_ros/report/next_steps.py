"""Next steps after a command: a sentence and the command to copy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import NamedTuple

from sgp_ros.physics.example import example_effect

Steps = Sequence[tuple[str, str]]
PLUS_MINUS = '+- is half the width of a 95 % interval'
_OTHER = 'OTHER.mcap'
"""Stands for a recording of the reader."""
_HANDED_BACK = {
    '.xml': 'mjcf', '.mjcf': 'mjcf', '.sdf': 'sdf', '.urdf': 'urdf', '.xacro': 'urdf',
}  # fmt: skip
"""Ending of a robot's file to the format of `sgp export`; the URDF beside the results holds
bodies alone."""


class Given(NamedTuple):
    """Inputs of a command.

    Attributes:
        bag: the recording.
        robot: built-in name or file.
        gains: file of gains; None without.
        last: the last of several recordings; None of one.
    """

    bag: str
    robot: str
    gains: str | None = None
    last: str | None = None

    def words(self, bag: str) -> str:
        """Return the words for a recording of the same machine."""
        gains = '' if self.gains is None else f' --gains {quote(self.gains)}'
        return f'{quote(bag)} --robot {quote(self.robot)}{gains}'


def after_diagnosis(verdict: str, given: Given, out: Path, *, has_setup_error: bool) -> Steps:
    """Return what to do with a diagnosis, the results of which are in `out`."""
    bag, diagnosed = given.bag, _path(out / 'robot_diagnosed.yaml')
    again = f'sgp diagnose {given.words(bag)} --out {_path(out)}'
    if has_setup_error:
        return [('Correct the set-up or the robot file, record, and diagnose again:', again)]
    if verdict == 'no_mismatch':
        other = f'sgp diagnose {given.words(_OTHER)}'
        return [('Nothing to correct. A larger or faster motion may show more:', other)]
    if verdict == 'unexplained':
        learn = f'sgp replay {quote(bag)} --robot {diagnosed}'
        steps = [('Learn the unexplained part with a Gaussian process:', learn)]
        if given.last is not None:
            apart = f'sgp diagnose {given.words(given.last)} --sim {quote(bag)}'
            steps.insert(0, ('Look for what the last recording has and the first has not:', apart))
        return steps
    steps = [
        ('Check the corrected robot on another recording:',
         f'sgp replay {_OTHER} --robot {diagnosed}'),
        ('Simulate the corrected robot:', f'sgp simulate {diagnosed}'),
    ]  # fmt: skip
    if (to := _HANDED_BACK.get(Path(given.robot).suffix.lower())) is not None:
        steps.append(('Write the corrected robot in the format of its file:',
                      f'sgp export {diagnosed} --to {to} --ranges'))  # fmt: skip
    return steps


def after_identification(robot: str, out: Path, *, has_bodies: bool) -> Steps:
    """Return what to do with an identified robot.

    Args:
        robot: as it was given.
        out: folder of the results.
        has_bodies: whether the robot has nominal bodies, which a diagnosis needs.
    """
    identified = _path(out / 'robot_identified.yaml')
    steps = [('Use the identified robot on another recording:',
              f'sgp replay {_OTHER} --robot {identified}')]  # fmt: skip
    if has_bodies:
        steps.append(('Find what physics the model lacks:',
                      f'sgp diagnose {_OTHER} --robot {quote(robot)}'))  # fmt: skip
    return steps


def after_replay(out: Path) -> Steps:
    """Return what to do with a model that was learned online."""
    robot, model = _path(out / 'robot_identified.yaml'), _path(out / 'model.npz')
    command = f'sgp replay {_OTHER} --robot {robot} --model {model}'
    return [('Continue learning on another recording:', command)]


def after_demo(bag: Path) -> Steps:
    """Return what to do after the demonstration."""
    return [
        ('Find what the model lacked (the friction of the wheel):',
         f'sgp diagnose {_path(bag)} --robot reaction_wheel_6'),
        ('Use a recording of your own robot:', f'sgp identify {_OTHER} --robot ROBOT.urdf'),
    ]  # fmt: skip


def after_import(
    path: Path, robot: str | None, gains: Path | None = None, *, has_poses: bool = False
) -> Steps:
    """Return what to do with an imported recording of a robot; None where it is not known."""
    command = f'sgp diagnose {_path(path)} --robot ' + (quote(robot) if robot else 'ROBOT.urdf')
    if gains is not None:
        command += f' --gains {_path(gains)}'
    if has_poses:
        command += ' --static'
    return [('Find what physics the model lacks:', command)]


def after_check(given: Given, *, is_fit: bool) -> Steps:
    """Return what to do with a recording that was checked."""
    verb = 'diagnose' if is_fit else 'check'
    said = (
        'Find what physics the model lacks:'
        if is_fit
        else 'Correct the problem, then check again:'
    )
    return [(said, f'sgp {verb} {given.words(given.bag)}')]


def after_simulation(path: Path, robot: str) -> Steps:
    """Return what to do with a simulated recording of a robot."""
    return [('Find the effects that were added:',
             f'sgp diagnose {_path(path)} --robot {quote(robot)}')]  # fmt: skip


def after_robots(name: str) -> Steps:
    """Return what to do with a built-in robot."""
    return [('Simulate one of them:', f'sgp simulate {name}')]


def after_effects(robot: str | None) -> Steps:
    """Return what to do with a list of effects."""
    place = f'double_pendulum --effect {example_effect("elbow", 0.05)}'
    return [
        ('Simulate a robot with an effect:', f'sgp simulate {quote(robot) if robot else place}')
    ]


def after_export(path: Path) -> Steps:
    """Return what to do with an exported robot that can be read again; nothing with another."""
    readable = path.suffix in {'.xml', '.urdf', '.sdf'}
    step = ('Read it again and simulate it:', f'sgp simulate {_path(path)}')
    return [step] if readable else [('Load it in the program that it was written for:', str(path))]


def after_campaign(out: Path) -> Steps:
    """Return what to do with the results of many recordings."""
    return [('Repeat it with more recordings; finished ones are kept:',
             f'sgp campaign RECORDINGS --robot ROBOT.urdf --out {_path(out)}')]  # fmt: skip


def ending(out: Path, steps: Steps) -> str:
    """Return the last lines of a command: legend, its page, the next steps."""
    return f'{PLUS_MINUS}\nreport: {out / "report.html"}\n{next_lines(steps)}'


def next_lines(steps: Steps) -> str:
    """Return the steps as lines of a terminal."""
    return '\n'.join(f'next: {said}\n  {command}' for said, command in steps)


def _path(path: Path) -> str:
    return quote(str(path))
