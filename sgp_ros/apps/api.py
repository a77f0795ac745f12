"""The commands as functions. They return the results that the commands write to files.

    >>> import sgp_ros as sgp
    >>> d = sgp.diagnose('real.mcap', robot='arm.urdf', tests=['other.mcap'])  # doctest: +SKIP
    >>> print(d)  # doctest: +SKIP
    Missing on elbow: Coulomb friction, level 0.3170 +- 0.0020 N m (probability 0.99); ...
    >>> d.findings[0].parameters['level'].value  # doctest: +SKIP
    0.317
    >>> d.save('out')  # doctest: +SKIP

Nothing is printed. An error that a user can cause raises an `SgpError`, which says in one line
what was found, what was expected and what to do.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from html import escape
from io import StringIO
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from sgp_ros.apps.diagnose import Examined, examine, write_examined
from sgp_ros.apps.identify import (
    IdentifiedRecording,
    identify_recording,
    write_identified_recording,
)
from sgp_ros.apps.simulation import run_simulation
from sgp_ros.batch.identification import Identification
from sgp_ros.diagnosis.result import Diagnosis, Finding, Parameter, ParameterError
from sgp_ros.errors import ConfigError
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.diagnosis import picture_of
from sgp_ros.report.diagnosis_figures import draw_diagnosis
from sgp_ros.report.diagnosis_text import effect_name, numbers
from sgp_ros.report.identification import draw_prediction
from sgp_ros.report.identification_text import verdict
from sgp_ros.report.page import robot_styles, typeset
from sgp_ros.report.verdict import verdict_sentence
from sgp_ros.robots.registry import load_robot

__all__ = ['diagnose', 'identify', 'load_robot', 'open_recording', 'simulate']

Place = str | PathLike[str]
_SIMULATED_S = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosed:
    """A diagnosis, for use in a program or a notebook.

    Attributes:
        examined: what the command `sgp diagnose` has before it writes.
    """

    examined: Examined

    @property
    def result(self) -> Diagnosis:
        """Everything that was found: validation, rivals, traces, visibility."""
        return self.examined.found

    @property
    def verdict(self) -> str:
        """One of `no_mismatch`, `parameters_only`, `setup_error`, and so on."""
        return self.result.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The effects that are asserted, most probable first."""
        return self.result.findings

    @property
    def parameter_errors(self) -> tuple[ParameterError, ...]:
        """Inertial parameters that differ from those of the robot file."""
        return self.result.parameter_errors

    def plot(self, name: str = 'time') -> Figure:
        """Return a figure of the report.

        Args:
            name: its file stem: `time`, `location`, `bands`, `law`, `dependence`, `proof`.

        Raises:
            ConfigError: this diagnosis has no such figure.
        """
        figures = draw_diagnosis(self.result)
        if name not in figures:
            raise ConfigError(f'no figure {name!r}', f'one of {sorted(figures)}')
        return figures[name]

    def save(self, out: Place) -> Path:
        """Write diagnosis.json, the report and the corrected robot; return the page's path."""
        write_examined(Path(out), self.examined)
        return Path(out) / 'report.html'

    def __str__(self) -> str:
        """Return the verdict in a sentence."""
        return verdict_sentence(self.result)

    def _repr_html_(self) -> str:
        """Return verdict, robot and findings for a notebook."""
        rows = ''.join(
            f'<tr><td>{escape(f.joint)}</td><td>{escape(effect_name(f))}</td>'
            f'<td>{escape(typeset(", ".join(numbers(f))))}</td><td>{f.probability:.2f}</td></tr>'
            for f in (*self.result.setup, *self.findings)
        )
        head = '<tr><th>joint</th><th>effect</th><th>parameters</th><th>probability</th></tr>'
        table = f'<table>{head}{rows}</table>' if rows else ''
        picture = picture_of(self.result, self.examined.nominal.tree)
        return f'<p><b>{escape(typeset(str(self)))}</b></p>{robot_styles()}{picture}{table}'


@dataclass(frozen=True, slots=True, eq=False)
class Identified:
    """An identified robot, for use in a program or a notebook.

    Attributes:
        recording: what the command `sgp identify` has before it writes.
    """

    recording: IdentifiedRecording

    @property
    def result(self) -> Identification:
        """The fits, the filter, what was held out."""
        return self.recording.found

    @property
    def findings(self) -> dict[str, Any]:
        """The content of identification.json."""
        return self.recording.findings

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The parameters that this motion determines, by name."""
        return {
            p['name']: Parameter(p['value'], p['std'], p['unit'])
            for p in self.findings['parameters']
            if p['std'] is not None
        }

    def plot(self) -> Figure:
        """Return the prediction of what was held out, over what was measured."""
        return draw_prediction(self.result, next(iter(self.result.held)))

    def save(self, out: Place) -> Path:
        """Write identification.json, the report and the robot; return the path of the page."""
        write_identified_recording(Path(out), self.recording)
        return Path(out) / 'report.html'

    def __str__(self) -> str:
        """Return in a sentence how well what was held out is predicted."""
        return verdict(self.findings)

    def _repr_html_(self) -> str:
        """Return verdict and parameters for a notebook."""
        rows = ''.join(
            f'<tr><td>{escape(name)}</td><td>{p.value:.5g}</td>'
            f'<td>± {INTERVAL_95 * (p.std or 0.0):.2g}</td><td>{escape(p.unit)}</td></tr>'
            for name, p in self.parameters.items()
        )
        return f'<p><b>{escape(typeset(str(self)))}</b></p><table>{rows}</table>'


def diagnose(bag: Place | Sequence[Place], robot: Place, **options: Any) -> Diagnosed:
    """Return what physics one or several recordings have that the nominal robot lacks.

    Args:
        bag: a recording, or several of one machine.
        robot: a built-in name, or the file of a robot.
        options: as of the command: `sim`, `tests`, `gains`, `effort`, `joint_states`, `command`,
            `static`, `bodies`.

    Raises:
        SgpError: a robot, a recording or an option that cannot be used.
    """
    bags = [bag] if isinstance(bag, str | PathLike) else bag
    return Diagnosed(examine([fspath(b) for b in bags], fspath(robot), **_plain(options)))


def identify(bag: Place, robot: Place, **options: Any) -> Identified:
    """Return a robot identified from a whole recording.

    Args:
        bag: the recording.
        robot: a built-in name, or the file of a robot.
        options: as of the command: `tests`, `inputs`, `holdout`, `share`, `cutoff`, and so on.

    Raises:
        SgpError: a robot, a recording or an option that cannot be used.
    """
    return Identified(identify_recording(fspath(bag), fspath(robot), **_plain(options)))


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    """Return options with paths as text."""
    return {
        name: [fspath(x) for x in value] if name == 'tests' else
        fspath(value) if isinstance(value, PathLike) else value
        for name, value in options.items()
    }  # fmt: skip


def simulate(robot: Place, out: Place, **options: Any) -> Path:
    """Simulate a robot, write its recording and true parameters; return the recording's path.

    Args:
        robot: a built-in name, or the file of a robot.
        out: folder.
        options: as of the command: `duration`, `effects`, `sensors`, `seed`, and so on.

    Raises:
        SgpError: a robot or an option that cannot be used.
    """
    options = {'duration': _SIMULATED_S, **options}
    with redirect_stdout(StringIO()):
        done = run_simulation(fspath(robot), Path(out), lambda _share: None, **options)
    return Path(done['recording'])
