"""A concealed effect whose size is still open, and what it needs to know of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sgp_proof.concealed.unknown import UNKNOWN
from sgp_ros.simulation.mechanism import ChosenEffect

SCORED = {
    'viscous_friction': ['b'], 'coulomb_friction': ['level'],
    'stribeck_friction': ['coulomb', 'static'], 'quadratic_drag': ['c'],
    'position_friction': ['amplitude'], 'limit_friction': ['amplitude', 'onset'],
    'asymmetric_coulomb': ['level_pos', 'level_neg'], 'spring': ['stiffness', 'rest'],
    'gravity_tilt': ['roll', 'pitch'], 'payload': ['mass'], 'cogging': ['amplitude', 'periods'],
    'torque_gain': ['gain'], 'dead_zone': ['width'], 'saturation': ['limit'],
    'actuator_lag': ['time_constant'], 'command_delay': ['delay'], 'backlash': ['gap'],
    'hysteresis': ['level', 'presliding'], 'armature': ['inertia'],
    'encoder_eccentricity': ['amplitude', 'periods'], 'velocity_filter_lag': ['time_constant'],
    'friction_drift': ['start', 'end', 'time_constant'], 'constant_load': ['force'],
    'tip_force': ['fx', 'fy', 'fz'], 'load_friction': ['mu'], 'end_stop': ['position'],
}  # fmt: skip
"""Parameters whose estimates are scored."""


class UnsuitableError(Exception):
    """The robot or its motion cannot show this effect."""


@dataclass
class Concealed:
    """An effect whose size is still open: `values(size)` are its parameters.

    `power` says how its share of the squared effort grows with the size.
    """

    name: str
    joint: str
    index: int
    values: object
    size: float
    power: float = 2.0
    largest: float = math.inf
    location: dict = field(default_factory=dict)

    @property
    def parameters(self):
        return self.values(self.size)

    def chosen(self):
        """Return the effect for the simulation; None where it has no name."""
        if self.name == 'unknown':
            return None
        return ChosenEffect(self.name, self.joint, self.parameters)

    def unlisted(self, joints):
        if self.name != 'unknown':
            return ()
        return UNKNOWN[self.parameters['kind']](self.index, self.parameters, joints)


@dataclass(frozen=True)
class Motion:
    """What a pilot run of the nominal robot showed: rms and extremes, per joint."""

    effort: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    high: np.ndarray
    positions: np.ndarray
