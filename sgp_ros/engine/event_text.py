"""Events and states as JSON holds them, in which every float reads back to the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np

from sgp_ros.engine.intake import State
from sgp_ros.engine.samples import (
    EFFORT,
    CommandSample,
    Event,
    JointSample,
    Reset,
    SettingsChange,
    frozen_array,
)


def _listed(values: np.ndarray | None) -> list[float] | None:
    return None if values is None else [float(value) for value in values]


def encode(event: Event) -> dict[str, Any]:
    """Return an event as JSON holds it."""
    if isinstance(event, JointSample):
        return {
            'kind': 'state', 'stamp_ns': event.stamp_ns, 'names': event.names,
            'position': _listed(event.position), 'velocity': _listed(event.velocity),
            'effort': _listed(event.effort),
        }  # fmt: skip
    if isinstance(event, CommandSample):
        return {
            'kind': 'command', 'stamp_ns': event.stamp_ns, 'names': event.names,
            'effort': _listed(event.effort), 'asks': event.kind,
            'velocity': _listed(event.velocity),
        }  # fmt: skip
    if isinstance(event, SettingsChange):
        return {'kind': 'change', 'stamp_ns': event.stamp_ns, 'settings': dict(event.settings)}
    return {'kind': 'reset', 'stamp_ns': event.stamp_ns}


def decode(entry: dict[str, Any]) -> Event:
    """Return the event that `encode` was given."""
    stamp = entry['stamp_ns']
    if entry['kind'] == 'state':
        velocity, effort = (
            None if entry[name] is None else frozen_array(entry[name])
            for name in ('velocity', 'effort')
        )
        names = tuple(entry['names'])
        return JointSample(stamp, names, frozen_array(entry['position']), velocity, effort)
    if entry['kind'] == 'command':
        known = None if entry['names'] is None else tuple(entry['names'])
        rates = entry.get('velocity')
        return CommandSample(
            stamp, frozen_array(entry['effort']), known, entry.get('asks', EFFORT),
            None if rates is None else frozen_array(rates),
        )  # fmt: skip
    if entry['kind'] == 'change':
        return SettingsChange(stamp, entry['settings'])
    return Reset(stamp)


def encode_state(state: State) -> list[Any]:
    """Return a state as JSON holds it."""
    return [
        state.stamp_ns, _listed(state.position), _listed(state.velocity), _listed(state.effort)
    ]  # fmt: skip


def decode_state(entry: list[Any]) -> State:
    """Return the state that `encode_state` was given."""
    position, velocity, effort = (None if x is None else np.array(x) for x in entry[1:])
    assert position is not None
    return State(entry[0], position, velocity, effort)
