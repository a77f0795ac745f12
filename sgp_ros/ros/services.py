"""The services of a node: refit, reset, save, learn, diagnose, cancel."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from sgp_ros.engine.samples import SettingValue
from sgp_ros.recordings.model_files import is_model
from sgp_ros.ros.diagnosing import Diagnosing
from sgp_ros.ros.record import save_file
from sgp_ros.ros.session import Session
from sgp_ros.ros.settings import SAVE_NAME


class Services:
    """Answers what a node is asked for.

    Args:
        node: that offers them.
        session: of which they tell, or which they change.
        diagnosing: starts diagnoses.
        settings: of the node, as they were at its start.
    """

    def __init__(
        self,
        node: Node,
        session: Session,
        diagnosing: Diagnosing,
        settings: Mapping[str, SettingValue],
    ) -> None:
        self._node = node
        self._session = session
        self._diagnosing = diagnosing
        self._file = save_file(str(settings['save.path']), node.get_fully_qualified_name())
        self._offered = [
            node.create_service(kind, f'~/{name}', partial(self._guarded, answer))
            for name, kind, answer in self._all()
        ]

    def _all(self) -> tuple[tuple[str, type, Callable[[Any, Any], Any]], ...]:
        return (
            ('refit', Trigger, self._refit),
            ('reset', Trigger, self._reset),
            ('save', Trigger, self._save),
            ('diagnose', Trigger, self._diagnose),
            ('cancel_diagnosis', Trigger, self._cancel),
            ('learn', SetBool, self._learn),
        )

    def close(self) -> None:
        """Offer them no more."""
        for service in self._offered:
            self._node.destroy_service(service)

    def _guarded(self, answer: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Answer: an error that only a bug can cause ends nothing."""
        try:
            return answer(request, response)
        except Exception as error:  # noqa: BLE001 - the edge of the node: it must go on
            self._session.health.note_error(error, answer.__name__)
            response.success, response.message = False, f'internal error: {error}'
            return response

    def _refit(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._session.refit()
        response.message = 'a fit was started; its outcome will be on /diagnostics'
        if not response.success:
            initial = self._session.engine.config.learning_initial
            response.message = f'too few samples to fit; learning.initial = {initial} are needed'
        return response

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._session.reset()
        response.success, response.message = True, 'everything learned was reset'
        return response

    @staticmethod
    def problem_of(parameters: Iterable[Parameter[Any]]) -> str | None:
        """Return why parameters to be set name no file to save in, or None."""
        names = (p.value for p in parameters if p.name == SAVE_NAME.name)
        return next(filter(None, map(SAVE_NAME.problem, names)), None)

    def autosave(self) -> None:
        """Save without keeping messages waiting; what fails is logged."""
        try:
            self._session.save_beside(self._file)
        except OSError as error:
            self._node.get_logger().error(f'not saved: {error}')

    def _save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        name = self._node.get_parameter(SAVE_NAME.name).value
        path = self._file.with_name(f'{name}.npz') if name else self._file
        try:
            if name and os.path.lexists(path) and not is_model(path):
                raise FileExistsError(f'{path} exists and is not a saved model')
            self._session.save(path)
        except OSError as error:
            response.success, response.message = False, f'not saved: {error}'
        else:
            response.success, response.message = True, str(path)
        return response

    def _diagnose(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._diagnosing.start(self._session.engine.config)
        return response

    def _cancel(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._diagnosing.cancel()
        return response

    def _learn(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        is_wanted = bool(request.data)
        (result,) = self._node.set_parameters([Parameter('learning.enabled', value=is_wanted)])
        response.success = result.successful
        response.message = result.reason or f'learning.enabled = {is_wanted}'
        return response
