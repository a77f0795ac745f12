"""Messages of rclpy, made from the same fields as those of a recording."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np


@cache
def message_class(kind: str) -> type:
    """Return the class of messages of type `kind`, such as `sensor_msgs/JointState`."""
    package, name = kind.split('/')
    found: type = getattr(import_module(f'{package}.msg'), name)
    return found


def new_message(kind: str, **fields: Any) -> Any:
    """Return a message of type `kind`; arrays become lists."""
    values = {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in fields.items()}
    return message_class(kind)(**values)
