"""Message types as bags know them: classes, definitions, hashes and one topic's description."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
import os
from pathlib import Path
import re
from typing import Any

import numpy as np
from rosbags.interfaces import Qos
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

from deck_motion_ros.samples import Array

PRIMITIVES = frozenset((
    'bool', 'byte', 'char', 'float32', 'float64', 'int8', 'uint8', 'int16', 'uint16', 'int32',
    'uint32', 'int64', 'uint64', 'string', 'wstring'))
FIELD = re.compile(r'^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]', re.MULTILINE)


class BagError(ValueError):
    """A bag that cannot be read or written; the text names the file and what is wrong."""


@dataclass(frozen=True)
class BagTopic:
    """
    One topic of a bag.

    Attributes
    ----------
    name, type : str
        Absolute topic name, ROS message type such as ``sensor_msgs/msg/Imu``.
    definition : str
        The type's text with those of all types inside it (``ros2msg``); ``''`` = not known.
    type_hash : str
        ``RIHS01_...``; ``''`` = not known.
    qos : tuple of Qos
        What each publisher offered.

    """

    name: str
    type: str
    definition: str = ''
    type_hash: str = ''
    qos: tuple[Qos, ...] = ()


@lru_cache(maxsize=1)
def jazzy() -> Typestore:
    """Return the message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


class BagTypes:
    """rosbags' message classes by ROS type name, for :mod:`deck_motion_ros.messages`."""

    def __getitem__(self, name: str) -> type[Any]:
        return jazzy().types[name]

    def floats(self, values: Iterable[float]) -> Array:
        """Return what rosbags takes for a float64[] field."""
        return np.asarray(values if hasattr(values, '__len__') else list(values), float)

    def byte(self, value: int) -> int:
        """Return what rosbags takes for a byte field."""
        return value


def encode(type_name: str, message: object) -> bytes:
    """Serialise a message made from :class:`BagTypes` to CDR."""
    return bytes(jazzy().serialize_cdr(message, type_name))


def describe(type_name: str) -> tuple[str, str]:
    """
    Look up the definition and the hash of a message type.

    Types that are not part of ROS 2 Jazzy are looked for in the share folders of the packages
    under ``AMENT_PREFIX_PATH``.

    Returns
    -------
    definition, type_hash : str
        ``''`` where not known.

    """
    store = jazzy()
    if type_name in store.types:
        return store.generate_msgdef(type_name, ros_version=2)[0], store.hash_rihs01(type_name)
    return _installed_definition(type_name), ''


def _installed_definition(type_name: str) -> str:
    texts: dict[str, str] = {}

    def visit(name: str) -> bool:
        package, kind = name.split('/')[0], name.split('/')[-1]
        paths = (Path(prefix, 'share', package, 'msg', f'{kind}.msg')
                 for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if prefix)
        path = next((path for path in paths if path.is_file()), None)
        if path is None:
            return False
        texts[f'{package}/{kind}'] = text = path.read_text(encoding='utf-8')
        inside = {field if '/' in field else f'{package}/{field}'
                  for field in FIELD.findall(re.sub('#.*', '', text)) if field not in PRIMITIVES}
        return all(field in texts or visit(field) for field in sorted(inside))

    if not visit(type_name):
        return ''
    root, *others = texts.items()
    return root[1] + ''.join(f'\n{"=" * 80}\nMSG: {name}\n{text}' for name, text in others)
