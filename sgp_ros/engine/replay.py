"""A whole stream through an engine, with the hyper-parameter fits that are due put in force.

To replace all factors at once would make one callback as long as those of many samples. Outputs
that share no factor are independent given W, so a model in which some have new hyper-parameters
and others still the old ones is valid; every step is a change of settings that a record holds and
a replay repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult, fit
from sgp_ros.engine.hyperparameters import prefix_of, settings_of
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import Event, SettingsChange, SettingValue
from sgp_ros.errors import ConfigError, NumericalError
from sgp_ros.gp.model import separable


class Swap:
    """The way of one fit into an engine; the engine counts what became of it.

    Attributes:
        fit: that is put in force.
        refusal: why the fit, or a part of it, is not in force, one of `results.REFIT_REFUSALS`;
            empty while nothing was refused.

    Args:
        engine: has a model.
        fit: for it.
    """

    def __init__(self, engine: Engine, fit: FitResult) -> None:
        self.fit = fit
        self._engine = engine
        self._parts: list[dict[str, SettingValue]] = []
        self.refusal = 'outdated' if fit.number < engine.stale_fits else fit.refusal
        if self.refusal:
            engine.count_refit(self.refusal)
            return
        assert fit.model is not None
        regression = engine.estimator.regression
        assert regression is not None
        settings = settings_of(engine.robot.joint_names, fit.model)
        for outputs in separable(regression.model, fit.model):
            if all(fit.model.output(j) == regression.model.output(j) for j in outputs):
                continue  # of many joints a fit takes some
            names = tuple(prefix_of(engine.robot.joint_names[j]) for j in outputs)
            self._parts.append({n: v for n, v in settings.items() if n.startswith(names)})

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        return not self._parts

    def step(self) -> SettingsChange | None:
        """Put the next part in force.

        Returns:
            The event to record; None where the buffer has no factor under that part, or no setting
            can have its values: it then keeps the hyper-parameters it has.
        """
        part = self._parts.pop(0)
        change = None
        try:
            change = self._engine.change(part)
        except NumericalError:
            self.refusal = 'no_factor'
        except ConfigError:
            self.refusal = 'diverged'
        if self.is_done:
            self._engine.count_refit(self.refusal)
        return change

    def finish(self) -> list[SettingsChange]:
        """Put all that is left in force; return the events to record."""
        changes = []
        while not self.is_done:
            change = self.step()
            if change is not None:
                changes.append(change)
        return changes


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
