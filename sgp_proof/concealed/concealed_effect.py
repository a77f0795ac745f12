"""A concealed effect whose size is still open, and what it needs to know of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from sgp_proof.concealed.unknown import NAME, UNKNOWN
from sgp_proof.concealed.unlisted import BUILDERS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt


class Outside(Effect):
    """Physics outside the catalogue: only the simulation knows its force."""

    name = NAME


OUTSIDE = Outside()


@dataclass
class Concealed:
    """An effect whose size is still open: `values(size)` are its parameters.

    `index` is that of the joint at which it is measured; `power` says how its share of the squared
    effort grows with the size.
    """

    unsized: EffectAt
    index: int
    values: object
    size: float
    power: float = 2.0
    largest: float = math.inf
    location: dict = field(default_factory=dict)

    @classmethod
    def of(cls, law, joint, *sized, **more):
        """Return a law at a joint, with what else there is to know."""
        return cls(EffectAt.wanted(law, joint, {}), *sized, **more)

    @property
    def at(self):
        """The effect with the parameters of its size."""
        return replace(self.unsized, parameters=self.values(self.size))

    def chosen(self):
        """Return the effect for the simulation; None where it has no name."""
        return None if self.unsized.effect is OUTSIDE else self.at

    def unlisted(self, joints):
        if self.unsized.effect is not OUTSIDE:
            return ()
        parameters = self.at.parameters
        return (UNKNOWN | BUILDERS)[parameters['kind']](self.index, parameters, joints)
