"""Laws that act in one of several recordings alone: a load taken up, friction that is lower."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity, Value
from sgp_ros.physics.place import Place, Placed
from sgp_ros.robots.observed_motion import ObservedMotion


class InRecording(Effect):
    """A law that acts in one recording alone; other attributes are those of the law.

    Args:
        law: the law.
        recording: index.
        signed: joints on which coefficients may have any sign, for other laws act there too.
    """

    def __init__(self, law: Effect, recording: int, signed: frozenset[int] = frozenset()) -> None:
        self.__dict__.update({name: getattr(law, name) for name in Effect.__annotations__})
        self.name = f'{law.name} in {recording}'
        self.is_body = False  # bodies are common to all recordings
        self.law, self.recording, self.signed = law, recording, signed
        if law.small is not None:
            self.small = replace(law.small, columns=self._masked(law.small.columns))

    def of(self, law: Effect) -> InRecording:
        """Return another law in the same recording."""
        return InRecording(law, self.recording, self.signed)

    def _masked(
        self, columns: Callable[[SeenMotion, Place, np.ndarray], np.ndarray]
    ) -> Callable[[SeenMotion, Place, np.ndarray], np.ndarray]:
        def masked(motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
            assert isinstance(motion, ObservedMotion)
            x = columns(motion, place, shape)
            if motion.recording is None:
                return np.zeros_like(x)
            inside = motion.recording == self.recording
            return x * inside.reshape(-1, *[1] * (x.ndim - 1))

        return masked

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the columns of the law; zero in every other recording."""
        return self._masked(self.law.columns)(motion, place, shape)

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether the law has signs and sizes that it can have."""
        is_signed = bool(self.linear) and at.place.joint in self.signed
        return is_signed or self.law.is_possible(at, motion)

    def stated_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return those of the law."""
        return self.law.stated_quantities(kind)

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return those of the law."""
        return self.law.coefficient_quantities(kind)

    def shape_names(self, kind: str = '') -> tuple[str, ...]:
        """Return those of the law."""
        return self.law.shape_names(kind)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return what the law reports."""
        return self.law.report(at, motion)

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return those of the law."""
        return self.law.places(motion)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return those of the law."""
        return self.law.starts(motion, place)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return those of the law."""
        return self.law.bounds(motion, place)

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return those of the law."""
        return self.law.scales(motion, place, shape)


def may_differ(law: Effect) -> bool:
    """Return whether a law is looked for in single recordings.

    Loads, mounts and friction change from one to the next, and a torque constant with its motor or
    amplifier; other laws of motors and couplings hardly do.
    """
    is_gain = law.effort_columns('') and len(law.quantities) == 1
    of_motor = law.has_source or law.is_of_command or (law.effort_columns('') and not is_gain)
    return law.is_force and not of_motor and (not law.shape_names() or law.is_on_tree)


def own_laws(effects: Iterable[EffectAt]) -> tuple[EffectAt, ...]:
    """Return the effects that act in one recording alone."""
    return tuple(s for s in effects if isinstance(s.effect, InRecording))


def within(model: Model, recording: int) -> Model:
    """Return a model as one recording alone shows it, with laws that hold everywhere."""
    effects = []
    for s in model.effects:
        if not isinstance(s.effect, InRecording):
            effects.append(s)
        elif s.effect.recording == recording:
            effects.append(replace(s, effect=s.effect.law))
    return replace(model, effects=tuple(effects))
