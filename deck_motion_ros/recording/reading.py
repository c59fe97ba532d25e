"""Bags in: messages of a rosbag2 folder or file in the order of their log time."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import Reader
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores, TypesysError
from rosbags.typesys.store import Typestore
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from deck_motion_ros.recording.definitions import BagError, BagTopic, describe, jazzy
from deck_motion_ros.recording.metadata import FileInfo, NEVER
from deck_motion_ros.recording.records import (
    ChunkPlace,
    is_whole,
    read_chunk,
    read_index,
    Record,
    salvage,
)

_Placed = tuple[int, int, str, int, bytes]  # a Record with its chunk's number in the bag
_log_time = itemgetter(0)
_order = itemgetter(0, 1)


class BagReader:
    """
    Read a bag.

    Parameters
    ----------
    folder : str or Path
        A rosbag2 folder, with or without ``metadata.yaml``, or one of its files. MCAP is read
        here; other rosbag2 bags (sqlite3, compressed files) through rosbags.

    Raises
    ------
    BagError
        If there is no bag, or it is truncated, damaged, foreign or holds no message; the text
        names the file.

    Attributes
    ----------
    path : Path
        The bag.
    bag_topics : dict of str to BagTopic
        By name.
    counts : dict of str to int
        Messages by topic.
    start, end : int
        First and last log time (ns).

    """

    def __init__(self, folder: str | Path) -> None:
        self.path = Path(folder)
        self._chunks: list[ChunkPlace] = []
        self._loose: list[Record] = []
        files = self._mcap_files()
        self._foreign = files is None
        parts = [self._open_foreign()] if files is None else [self._open(path) for path in files]
        self.bag_topics: dict[str, BagTopic] = {}
        self.counts: Counter[str] = Counter()
        for part in parts:
            self.bag_topics.update(part.topics)
            self.counts.update(part.counts)
        self.start = min(part.start for part in parts)
        self.end = max(part.end for part in parts)
        if not self.counts.total():
            raise BagError(f'{self.path}: the bag holds no message')
        self._loose.sort(key=_log_time)
        self._decoders: dict[str, Callable[[bytes], Any]] = {}

    @property
    def topics(self) -> dict[str, str]:
        """Return the types of the topics by name."""
        return {name: topic.type for name, topic in self.bag_topics.items()}

    def messages(self, topics: Collection[str] | None = None,
                 since: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """
        Yield (topic, log time, CDR) in the order of log time, equal times in the file's order.

        Parameters
        ----------
        topics : collection of str, optional
            Names; all if not given.
        since : int
            Leave out messages before this log time (ns).

        """
        for log_time, _, topic, _, data in self._chosen(topics, since):
            yield topic, log_time, data

    def records(self, topics: Collection[str] | None = None, since: int = 0) -> Iterator[Record]:
        """Yield (log time, topic, publish time, CDR) as :meth:`messages` does."""
        for log_time, _, topic, publish_time, data in self._chosen(topics, since):
            yield log_time, topic, publish_time, data

    def _chosen(self, topics: Collection[str] | None, since: int) -> Iterator[_Placed]:
        names = set(self.bag_topics if topics is None else topics) & set(self.bag_topics)
        stream = self._foreign_records() if self._foreign else self._mcap_records(since)
        if len(names) == len(self.bag_topics) and since <= self.start:
            return stream
        return (item for item in stream if item[2] in names and item[0] >= since)

    def decode(self, topic: str, data: bytes) -> Any:
        """
        Decode a message by the definition that the bag holds.

        Raises
        ------
        BagError
            If its type is not known or the bytes are no such message.

        """
        decoder = self._decoders.get(topic)
        if decoder is None:
            decoder = self._decoders[topic] = self._decoder(self.bag_topics[topic])
        try:
            return decoder(data)
        except (SerdeError, AssertionError, IndexError) as error:
            raise BagError(f'{self.path}: a message of {topic} is damaged: {error}') from None

    def _decoder(self, topic: BagTopic) -> Callable[[bytes], Any]:
        store = self._typestore(topic)
        kind = topic.type

        def decode(data: bytes) -> Any:
            return store.deserialize_cdr(data, kind)

        return decode

    def _typestore(self, topic: BagTopic) -> Typestore:
        """Return ROS 2 Jazzy's types if they define this one, else a store of the bag's own."""
        definition, type_hash = describe(topic.type) if topic.type in jazzy().types else ('', '')
        if definition and (definition == topic.definition or type_hash == topic.type_hash
                           or not topic.definition):
            return jazzy()
        try:
            if not topic.definition:
                raise KeyError(topic.type)
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(topic.definition, topic.type))
            store.get_msgdef(topic.type)
        except (TypesysError, KeyError):
            raise BagError(f'{self.path}: the type of {topic.name}, {topic.type or "none"}, '
                           'is not known') from None
        return store

    def _mcap_files(self) -> list[Path] | None:
        """List the files of an MCAP bag; None = rosbags may know what it is."""
        path = self.path
        if path.suffix == '.mcap' and path.is_file():
            return [path]
        if not path.is_dir():
            if path.suffix == '.db3' and path.is_file():
                return None
            raise BagError(f'{path}: ' + ('not a bag' if path.exists() else 'does not exist'))
        described = described_files(path)
        if described is not None and any(not name.endswith('.mcap') for name in described):
            return None
        files = (in_order(path.glob('*.mcap')) if described is None
                 else [path / name for name in described])
        if not files:
            hint = ', metadata.yaml is missing' if list(path.glob('*.db3')) else ''
            raise BagError(f'{path}: holds no bag that can be read{hint}')
        return files

    def _open(self, path: Path) -> FileInfo:
        """Enter the chunks of one MCAP file and return what it holds."""
        try:
            if not is_whole(path):
                empty = path.stat().st_size == 0
                raise BagError(
                    f"{path}: {'is empty' if empty else 'ends in the middle, its recorder died'}"
                    f"; 'deck_motion recover {self.path}' repairs it")
            index = read_index(path)
            if index is not None:
                self._chunks.extend(index[1])
                return index[0]
            return self._open_unindexed(path)
        except OSError as error:
            raise BagError(f'{path}: cannot be read: {error.strerror}') from None

    def _open_unindexed(self, path: Path) -> FileInfo:
        """Hold the messages of a file without index in memory."""
        found: dict[int, BagTopic] = {}
        loose = list(salvage(path, found))
        self._loose += loose
        return FileInfo(path, {topic.name: topic for topic in found.values()},
                        Counter(name for _, name, _, _ in loose),
                        min(map(_log_time, loose), default=NEVER),
                        max(map(_log_time, loose), default=-1))

    def _mcap_records(self, since: int) -> Iterator[_Placed]:
        pending: list[_Placed] = _placed(self._loose, 0)
        chunks = [(place.start, number, place) for number, place in enumerate(self._chunks)
                  if place.end >= since]
        chunks.sort(key=_order)
        limits = [start for start, _, _ in chunks[1:]] + [NEVER]
        for (_, number, place), limit in zip(chunks, limits, strict=False):
            try:
                pending += _placed(read_chunk(place), number)
            except BagError as error:
                raise BagError(
                    f"{error}; 'deck_motion recover {self.path}' saves the rest") from None
            pending.sort(key=_order)
            ready = bisect_left(pending, limit, key=_log_time)
            yield from pending[:ready]
            del pending[:ready]
        yield from pending

    def _open_foreign(self) -> FileInfo:
        info = FileInfo(self.path)
        try:
            with Reader(self.path) as reader:
                for connection in reader.connections:
                    known = connection.msgdef.format.name == 'MSG'
                    info.topics[connection.topic] = BagTopic(
                        connection.topic, connection.msgtype,
                        connection.msgdef.data if known else '', connection.digest,
                        tuple(getattr(connection.ext, 'offered_qos_profiles', ())))
                    info.counts[connection.topic] += connection.msgcount
                info.start, info.end = reader.start_time, reader.end_time - 1
        except Exception as error:  # there are many kinds of foreign files
            raise BagError(f'{self.path}: cannot be read: {error}') from None
        return info

    def _foreign_records(self) -> Iterator[_Placed]:
        try:
            with Reader(self.path) as reader:
                for connection, log_time, data in reader.messages():
                    yield log_time, 0, connection.topic, log_time, data
        except Exception as error:
            raise BagError(f'{self.path}: cannot be read: {error}') from None


def _placed(records: Iterable[Record], number: int) -> list[_Placed]:
    return [(time, number, topic, publish_time, data)
            for time, topic, publish_time, data in records]


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Sort NAME_2.mcap before NAME_10.mcap."""
    return sorted(paths, key=lambda path: (len(path.name), path.name))


def described_files(folder: Path) -> list[str] | None:
    """
    List the files that a bag's metadata.yaml names; None without one.

    Raises
    ------
    BagError
        If it cannot be read.

    """
    path = folder / 'metadata.yaml'
    if not path.is_file():
        return None
    try:
        about = YAML(typ='safe').load(path.read_text(encoding='utf-8'))
        names = about['rosbag2_bagfile_information']['relative_file_paths']
        return [Path(name).name for name in names]
    except (YAMLError, KeyError, TypeError, UnicodeDecodeError, OSError) as error:
        raise BagError(f"{path}: damaged ({type(error).__name__}); "
                       f"'deck_motion recover {folder}' repairs it") from None
