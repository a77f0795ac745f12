"""Write changes of settings as JSON text that reads back exactly.

A float is written with the shortest digits that give the same float, an array as a list. JSON
keeps `1` and `1.0` apart, so the types of the settings survive.
"""

from __future__ import annotations

import json

from sgp_ros.engine.samples import Reset, SettingsChange, SettingValue
from sgp_ros.errors import MessageError

_EXPECTED = '{"change": "settings" or "reset", "stamp_ns": integer, "settings": {...}}'


def change_to_text(change: SettingsChange | Reset) -> str:
    """Return `change` as one line of JSON."""
    if isinstance(change, Reset):
        return json.dumps({'change': 'reset', 'stamp_ns': change.stamp_ns})
    return json.dumps(
        {
            'change': 'settings',
            'stamp_ns': change.stamp_ns,
            'settings': dict(change.settings),
        }
    )


def change_from_text(text: str) -> SettingsChange | Reset:
    """Return the change that `change_to_text` wrote.

    Raises:
        MessageError: the text is something else.
    """
    try:
        content = json.loads(text)
    except ValueError as error:
        raise MessageError('change of settings that is no JSON', _EXPECTED) from error
    if not isinstance(content, dict) or type(content.get('stamp_ns')) is not int:
        raise MessageError('change of settings without a stamp', _EXPECTED)
    if content.get('change') == 'reset':
        return Reset(content['stamp_ns'])
    settings = content.get('settings')
    if content.get('change') != 'settings' or not isinstance(settings, dict):
        raise MessageError('change of settings of an unknown kind', _EXPECTED)
    values = {name: _setting(name, value) for name, value in settings.items()}
    return SettingsChange(content['stamp_ns'], values)


def _setting(name: str, value: object) -> SettingValue:
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, list):
        if all(isinstance(item, str) for item in value):
            return tuple(value)
        if all(isinstance(item, (int, float)) for item in value):
            return tuple(value)
    raise MessageError(f'setting {name} of a strange type', 'a number, text or a list of one kind')
