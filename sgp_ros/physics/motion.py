"""Views of a recording and a robot that laws of physics ask for; who has them stands above.

A law reads a motion on one uniform grid, the commands behind it, and a few quantities of the
rigid-body model, such as the efforts that hold the robot against gravity. Those need a dynamics
library; the laws do not, so they name here what they take.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np


class NamedPoint(Protocol):
    """Origin of a frame that is fixed to a body."""

    @property
    def name(self) -> str:
        """Name of the link."""

    @property
    def body(self) -> int:
        """Index of the body, -1 for the root."""

    @property
    def translation(self) -> np.ndarray:
        """Origin in the frame of the body's joint, (3,) [m]."""


class CarriedLink(Protocol):
    """A link while the robot moves; all directions are along the axes of the root."""

    def points(self, at: np.ndarray) -> np.ndarray:
        """Return where a point (3,) of the link is, (n, 3) [m]."""

    def columns(self, at: np.ndarray) -> np.ndarray:
        """Return the efforts of a unit force along each axis on a point, (n, k, 3)."""


class Structure(Protocol):
    """Joints and nominal bodies of a robot, of which the first k move on their own."""

    @property
    def size(self) -> int:
        """Number of joints that move on their own, k."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of all b joints."""

    @property
    def moving_names(self) -> tuple[str, ...]:
        """Names of those that move on their own, (k,)."""

    @property
    def is_prismatic(self) -> np.ndarray:
        """Whether each joint slides, (b,)."""

    @property
    def parents(self) -> np.ndarray:
        """Body that each joint starts from, -1 for the root, (b,)."""

    @property
    def outermost(self) -> tuple[int, ...]:
        """Joints whose links carry loads."""

    @property
    def is_actuated(self) -> np.ndarray:
        """Whether an effort acts on it, (b,)."""

    @property
    def lower(self) -> np.ndarray:
        """Least positions, (b,) [rad or m]."""

    @property
    def upper(self) -> np.ndarray:
        """Greatest positions, (b,) [rad or m]."""

    @property
    def damping(self) -> np.ndarray:
        """Nominal viscous coefficients, (b,) [N m s/rad or N s/m]."""

    @property
    def gravity(self) -> np.ndarray:
        """Acceleration of free fall in the frame of the root, (3,) [m/s^2]."""

    @property
    def parameters(self) -> np.ndarray:
        """Nominal inertial parameters: m, m c, inertia about the joint's origin, (b, 10)."""

    @property
    def frames(self) -> Sequence[NamedPoint]:
        """All links by name."""

    @property
    def tool(self) -> NamedPoint | None:
        """Moving link called `tool0`."""

    @property
    def tool_body(self) -> int:
        """Body that carries the tool; -1 where several could."""


class Commands(Protocol):
    """Commands that the drives receive."""

    @property
    def values(self) -> np.ndarray:
        """Commands, (c, k) [N m or N]."""

    def effort(
        self, joint: int, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the effort of a joint behind delay, characteristic and lag, (n,) [N m or N]."""


@runtime_checkable
class RecordedCommands(Commands, Protocol):
    """Commands of whole recordings, which can be exchanged for others."""

    def changed(
        self, change: Callable[[np.ndarray], np.ndarray], later: float
    ) -> RecordedCommands:
        """Return other commands (c, k), some time later [s]."""

    @property
    def rows(self) -> int:
        """Number n of rows on which their efforts are wanted."""

    def on(self, stretches: Sequence[slice]) -> RecordedCommands:
        """Return the commands of some stretches of the rows, in the order of the rows."""


class SeenMotion(Protocol):
    """n rows of the k joints of a robot on a uniform grid, as a law sees them."""

    @property
    def tree(self) -> Structure:
        """Nominal robot."""

    @property
    def time(self) -> np.ndarray:
        """Time since the first state of the recording, (n,) [s]."""

    @property
    def step(self) -> float:
        """Step of the grid [s]."""

    @property
    def starts(self) -> tuple[int, ...]:
        """Rows at which the grid begins anew after a pause."""

    @property
    def bandwidth(self) -> float:
        """Frequency up to which equations are formed of it [Hz]."""

    @property
    def position(self) -> np.ndarray:
        """Positions, (n, k) [rad or m]."""

    @property
    def velocity(self) -> np.ndarray:
        """Velocities, (n, k) [rad/s or m/s]."""

    @property
    def acceleration(self) -> np.ndarray:
        """Accelerations, (n, k) [rad/s^2 or m/s^2]."""

    @property
    def effort(self) -> np.ndarray:
        """Efforts, 0 for passive joints, (n, k) [N m or N]."""

    @property
    def drive(self) -> Commands | None:
        """Commands that the drives receive; None where only efforts were measured."""

    @property
    def direction(self) -> np.ndarray:
        """Mean of sign(v) over each cell of the grid, (n, k)."""

    def direction_of(self, speed: np.ndarray) -> np.ndarray:
        """Mean of the sign of speeds (n, ...) over each cell of the grid, (n, ...)."""

    @property
    def wrapped(self) -> np.ndarray:
        """Positions, those of continuous joints wrapped to [-pi, pi), (n, k)."""

    @property
    def moving_joints(self) -> tuple[int, ...]:
        """Indices of the joints that move."""

    @property
    def is_continuous(self) -> np.ndarray:
        """Whether each joint turns without limits, (k,)."""

    @property
    def mass_diagonal(self) -> np.ndarray:
        """Diagonal of the nominal mass matrix, rotors included, (n, k) [kg m^2 or kg]."""

    @property
    def rotors(self) -> np.ndarray:
        """Inertia that the nominal robot states beside its bodies, (k,) [kg m^2 or kg]."""

    @property
    def nominal_effort(self) -> np.ndarray:
        """Efforts that the nominal robot takes for this motion, (n, k) [N m or N]."""

    def driven(self, effort: np.ndarray, drive: Commands) -> SeenMotion:
        """Return the same motion of other efforts (n, k) by other commands."""

    def stated_number(self, name: str, joint: int) -> float:
        """Return what the nominal robot states of a number of a joint, such as its friction."""

    @property
    def gravity_columns(self) -> np.ndarray:
        """Efforts against a unit of gravity along each root axis, (n, k, 3)."""

    @property
    def tool_columns(self) -> np.ndarray:
        """Efforts of a unit force along the root axes at `tool0`, (n, k, 3); else (n, k, 0)."""

    @property
    def tool(self) -> CarriedLink | None:
        """Motion of the link that carries the tool; None where several are outermost."""

    @property
    def load_columns(self) -> Mapping[int, np.ndarray]:
        """Efforts per inertial parameter of each outermost link, by its joint, (n, k, 10)."""

    def effort_slopes(self, joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the slopes of the nominal efforts by the motion of one joint, (n, k) each."""

    def free_inertia(self, joint: int, rows: slice) -> float:
        """Return the least inertia of a joint while all others are free [kg m^2 or kg]."""
