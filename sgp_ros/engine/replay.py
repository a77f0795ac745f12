"""Runs a whole stream through an engine, with the hyper-parameter fits that are due."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import fit
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import Event, SettingsChange
from sgp_ros.engine.swap import Swap


def replay(
    engine: Engine,
    events: Iterable[Event],
    on_step: Callable[[Step], None],
    *,
    obey_record: bool = False,
    push: Callable[[Event], Step] | None = None,
) -> None:
    """Push all events, then flush.

    Args:
        engine: takes the events.
        events: the stream.
        on_step: sees what every push gave.
        obey_record: the stream is the record of a live run; its own changes of hyper-parameters
            are applied where they happened, and none is fitted here.
        push: stands for that of the engine, to watch it.
    """
    push = push or engine.push
    for event in events:
        on_step(push(event))
        _fit_if_due(engine, obey_record=obey_record)
    on_step(engine.flush())
    _fit_if_due(engine, obey_record=obey_record)


def is_record(events: Iterable[Event]) -> bool:
    """Whether a stream holds changes of hyper-parameters, as the record of a live run does."""
    return any(
        isinstance(event, SettingsChange)
        and any(name.startswith('hyper.') for name in event.settings)
        for event in events
    )


def _fit_if_due(engine: Engine, *, obey_record: bool) -> None:
    request = engine.take_fit_request()
    if request is not None and not obey_record:
        Swap(engine, fit(request)).finish()
