"""ROS messages of the standard types, made, written and read without ROS.

Type names are short (`sensor_msgs/JointState`). The definitions are those of ROS 2 Jazzy; a bag of
another distribution, or of ROS 1, has the same fields in these types.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from sgp_ros.errors import MessageError, RecordingError
from sgp_ros.recordings.messages import Message


def new_message(kind: str, **fields: Any) -> Message:
    """Return a message of type `kind`; every field must be given."""
    # rosbags holds an octet as a number
    values = {n: v[0] if isinstance(v, bytes) else v for n, v in fields.items()}
    return _message_class(kind)(**values)


def serialize(kind: str, message: Message) -> bytes:
    """Return the CDR bytes of a message of type `kind`."""
    return bytes(_typestore(Stores.ROS2_JAZZY).serialize_cdr(message, full_type(kind)))


def definition(kind: str) -> str:
    """Return the definition of type `kind` with those of its parts, as in an MCAP schema."""
    text, _ = _typestore(Stores.ROS2_JAZZY).generate_msgdef(full_type(kind), ros_version=2)
    return text


def decoder(kind: str, encoding: str) -> Callable[[bytes], Message]:
    """Return the function from bytes to a message of type `kind`.

    It raises a `MessageError` for bytes that are not such a message.

    Args:
        kind: short type name.
        encoding: `cdr` (ROS 2) or `ros1`.

    Raises:
        RecordingError: another encoding.
    """
    if encoding not in {'cdr', 'ros1'}:
        raise RecordingError(f'{kind} messages in encoding {encoding!r}', 'cdr (ROS 2) or ros1')
    store = _typestore(Stores.ROS1_NOETIC if encoding == 'ros1' else Stores.ROS2_JAZZY)
    read = store.deserialize_ros1 if encoding == 'ros1' else store.deserialize_cdr
    name = full_type(kind)

    def decode(data: bytes) -> Message:
        try:
            return read(data, name)
        except (SerdeError, IndexError, MemoryError) as error:
            raise MessageError(
                f'bytes that are not a valid {kind}', 'an intact message'
            ) from error

    return decode


def short_type(name: str) -> str:
    """Return a type name as `package/Type`, whether it says `/msg/` or not."""
    return name.replace('/msg/', '/')


def full_type(name: str) -> str:
    """Return a short type name as `package/msg/Type`."""
    return name.replace('/', '/msg/', 1)


@cache
def _message_class(kind: str) -> Callable[..., Message]:
    found: Callable[..., Message] = _typestore(Stores.ROS2_JAZZY).types[full_type(kind)]
    return found


@cache
def _typestore(store: Stores) -> Typestore:
    return get_typestore(store)
