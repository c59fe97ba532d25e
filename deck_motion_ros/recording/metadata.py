"""The bag's description, ``metadata.yaml``, as rosbag2 of ROS 2 Jazzy writes it (version 9)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
import json
import os
from pathlib import Path
import re
from typing import Any

from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9

from deck_motion_ros.recording.definitions import BagTopic

NEVER = 2**63 - 1
PLAIN = re.compile(r'[A-Za-z/][\w/.-]*')
RESERVED = frozenset(('true', 'false', 'null', 'yes', 'no', 'on', 'off', 'y', 'n'))


@dataclass
class FileInfo:
    """
    What one MCAP file holds.

    Attributes
    ----------
    path : Path
        The file.
    topics : dict of str to BagTopic
        By name.
    counts : Counter
        Messages by topic name.
    start, end : int
        First and last log time (ns).

    """

    path: Path
    topics: dict[str, BagTopic] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    start: int = NEVER
    end: int = -1

    @property
    def duration(self) -> int:
        """Nanoseconds from the first message to the last."""
        return max(self.end - self.start, 0)


def describe_bag(files: Iterable[FileInfo]) -> dict[str, Any]:
    """Return rosbag2's description of a bag as nested dicts, its fields in rosbag2's order."""
    files = list(files)
    topics: dict[str, BagTopic] = {}
    counts: Counter[str] = Counter()
    for file in files:
        topics.update(file.topics)
        counts.update(file.counts)
    start = min((file.start for file in files), default=NEVER)
    end = max((file.end for file in files), default=-1)
    return {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': max(end - start, 0)},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': sum(counts.values()),
        'topics_with_message_count': [
            {'topic_metadata': {
                'name': topic.name,
                'type': topic.type,
                'serialization_format': 'cdr',
                'offered_qos_profiles': dump_qos_v9(list(topic.qos)),
                'type_description_hash': topic.type_hash},
             'message_count': counts[topic.name]}
            for topic in topics.values()],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.path.name for file in files],
        'files': [
            {'path': file.path.name,
             'starting_time': {'nanoseconds_since_epoch': file.start},
             'duration': {'nanoseconds': file.duration},
             'message_count': sum(file.counts.values())}
            for file in files],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }


def write_metadata(folder: Path, files: Iterable[FileInfo]) -> None:
    """Write ``metadata.yaml`` in one step: it is the old one or the new one, never a part."""
    text = to_yaml({'rosbag2_bagfile_information': describe_bag(files)}) + '\n'
    draft = folder / '.metadata.yaml'
    try:
        draft.write_text(text, encoding='utf-8')
        os.replace(draft, folder / 'metadata.yaml')
    finally:
        draft.unlink(missing_ok=True)


def qos_text(qos: Iterable[Qos]) -> str:
    """Return offered QoS profiles as the text that a channel's metadata holds."""
    return to_yaml(dump_qos_v9(list(qos)))


def to_yaml(value: Any) -> str:
    """
    Write dicts, lists and scalars in the block style of rosbag2.

    >>> print(to_yaml({'files': [{'path': 'a_0.mcap', 'count': 2}], 'custom_data': None}))
    files:
      - path: a_0.mcap
        count: 2
    custom_data: ~
    """
    nested = isinstance(value, (dict, list)) and value
    return '\n'.join(_block(value)) if nested else _scalar(value)


def _block(value: Mapping[str, Any] | list[Any]) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            first, *rest = to_yaml(item).split('\n')
            yield f'- {first}'
            yield from (f'  {line}' for line in rest)
        return
    for key, item in value.items():
        if isinstance(item, (dict, list)) and item:
            yield f'{key}:'
            yield from (f'  {line}' for line in _block(item))
        else:
            yield f'{key}: {_scalar(item)}'


def _scalar(value: Any) -> str:
    if value is None:
        return '~'
    if isinstance(value, str) and PLAIN.fullmatch(value) and value.lower() not in RESERVED:
        return value
    text = json.dumps(value, ensure_ascii=False)
    return ''.join(char if char.isprintable() else f'\\U{ord(char):08x}' for char in text)
