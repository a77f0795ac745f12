"""A concealed effect whose size is still open, and what it needs to know of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sgp_proof.concealed.unknown import NAME, UNKNOWN
from sgp_proof.concealed.unlisted import BUILDERS
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt


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
        if self.name == NAME:
            return None
        return EffectAt.wanted(EFFECTS[self.name], self.joint, self.parameters)

    def unlisted(self, joints):
        if self.name != NAME:
            return ()
        return (UNKNOWN | BUILDERS)[self.parameters['kind']](self.index, self.parameters, joints)
