"""Bags out: MCAP files in a folder, as ``ros2 bag record -s mcap`` lays them out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
import os
from pathlib import Path
import shutil
from types import TracebackType

from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Qos

from deck_motion_ros.recording.definitions import BagError, BagTopic, describe
from deck_motion_ros.recording.metadata import (
    describe_bag,
    FileInfo,
    NEVER,
    qos_text,
    to_yaml,
    write_metadata,
)
from deck_motion_ros.samples import nanoseconds

CHUNK = 768 * 1024  # bytes, as rosbag2 has it
COMPRESSION = {'none': CompressionType.NONE, 'zstd': CompressionType.ZSTD,
               'lz4': CompressionType.LZ4}


class _Unbuffered:
    """A new file that holds nothing back: what was written survives the death of the process."""

    def __init__(self, path: Path) -> None:
        self._file = path.open('xb', buffering=0)
        self._size = 0

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:
            done = self._file.write(view)
            self._size += done
            view = view[done:]
        return len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self._file.close()


class McapFile:
    """
    One MCAP file being written.

    Parameters
    ----------
    path : Path
        The file; must not exist.
    compression : str
        ``none``, ``zstd`` or ``lz4``.
    chunk_size : int
        Bytes of messages in one chunk, before compression.

    """

    def __init__(self, path: Path, compression: str = 'none', chunk_size: int = CHUNK) -> None:
        self.info = FileInfo(path)
        self._output = _Unbuffered(path)
        self._writer = Writer(self._output, chunk_size=chunk_size,  # type: ignore[arg-type]
                              compression=COMPRESSION[compression])
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._writer.start('ros2', 'deck_motion_ros')

    def add(self, topic: BagTopic) -> None:
        """Enter a topic."""
        kind = topic.type, topic.definition
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                topic.type, 'ros2msg' if topic.definition else '', topic.definition.encode())
        self._channels[topic.name] = self._writer.register_channel(
            topic.name, 'cdr', self._schemas[kind],
            {'offered_qos_profiles': qos_text(topic.qos), 'topic_type_hash': topic.type_hash})
        self.info.topics[topic.name] = topic

    def write(self, topic: str, log_time: int, data: bytes, publish_time: int) -> None:
        """Enter a message."""
        self._writer.add_message(self._channels[topic], log_time, data, publish_time)
        info = self.info
        info.counts[topic] += 1
        if log_time < info.start:
            info.start = log_time
        if log_time > info.end:
            info.end = log_time

    def note(self, files: Iterable[FileInfo]) -> None:
        """Write the description of the whole bag, as far as it is known, into this file."""
        self._writer.add_metadata(
            'rosbag2', {'serialized_metadata': to_yaml(describe_bag(files))})

    def flush(self) -> None:
        """Write the messages so far as a chunk."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the rest and the index, and close the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._output.close()

    def abandon(self) -> None:
        """Close the file as it is; it can be recovered."""
        self._output.close()

    @property
    def size(self) -> int:
        """Bytes written."""
        return self._output.tell()


class BagWriter:
    """
    Write a bag: ``FOLDER/NAME_0.mcap`` ... and ``metadata.yaml``.

    Parameters
    ----------
    folder : str or Path
        The bag; must not exist.
    compression : str
        Of the chunks: ``none``, ``zstd`` or ``lz4``.
    max_size : int
        Begin a new file when one has this many bytes; 0 = never.
    max_duration : float
        Begin a new file when one has this many seconds of log time; 0 = never.
    atomic : bool
        Write under a hidden name beside ``folder`` and rename at the end: an error inside the
        ``with`` block leaves nothing. Otherwise what was written stays, for :func:`recover`.

    Raises
    ------
    BagError
        If the folder exists or cannot be written; later, if the disk is full.

    Attributes
    ----------
    folder : Path
        The bag.
    counts : Counter
        Messages by topic.
    topics : dict of str to BagTopic
        By name.
    saved : int
        Messages that were on the disk at the last flush.

    """

    def __init__(self, folder: str | Path, *, compression: str = 'none', max_size: int = 0,
                 max_duration: float = 0.0, atomic: bool = False) -> None:
        if compression not in COMPRESSION:
            raise BagError(f"compression must be one of {', '.join(COMPRESSION)}, "
                           f"not '{compression}'")
        if 0 < max_size < 1024:
            raise BagError(f'max_size must be 0 or at least 1024 bytes, not {max_size}')
        self.folder = Path(folder)
        self.counts: Counter[str] = Counter()
        self.topics: dict[str, BagTopic] = {}
        self.saved = 0
        self._name = self.folder.resolve().name
        self._atomic = atomic
        self._place = (self.folder.resolve().with_name(f'.{self._name}.{os.getpid()}.partial')
                       if atomic else self.folder)
        self._compression = compression
        self._max_size = max_size
        self._max_duration = nanoseconds(max_duration)
        self._chunk_size = min(CHUNK, max(1024, max_size // 8)) if max_size else CHUNK
        self._files: list[FileInfo] = []
        self._file: McapFile | None = None
        if self.folder.exists() or self.folder.is_symlink():
            raise BagError(f'{self.folder}: already exists')
        try:
            self._place.mkdir(parents=True)
        except OSError as error:
            raise BagError(f'{self.folder}: cannot be made: {error.strerror}') from None
        try:
            self._file = self._next_file()
        except OSError as error:
            shutil.rmtree(self._place, ignore_errors=True)
            raise BagError(f'{self.folder}: cannot be written: {error.strerror}') from None

    def add_topic(self, name: str, type_name: str, *, definition: str | None = None,
                  type_hash: str | None = None, qos: Iterable[Qos] = ()) -> BagTopic:
        """
        Enter a topic; a known name is left as it is.

        Parameters
        ----------
        name, type_name : str
            Absolute topic name; ROS type such as ``sensor_msgs/msg/Imu``.
        definition, type_hash : str, optional
            Of the type; looked up if not given.
        qos : iterable of Qos
            What the publishers offer.

        """
        known, known_hash = describe(type_name) if definition is None else (definition, '')
        return self.add(BagTopic(name, type_name, known,
                                 known_hash if type_hash is None else type_hash, tuple(qos)))

    def add(self, topic: BagTopic) -> BagTopic:
        """Enter a topic as a reader describes it."""
        if topic.name in self.topics:
            return self.topics[topic.name]
        self._open_file().add(topic)
        self.topics[topic.name] = topic
        return topic

    def write(self, topic: str, log_time: int, data: bytes,
              publish_time: int | None = None) -> None:
        """
        Write one message.

        Parameters
        ----------
        topic : str
            A name entered before.
        log_time, publish_time : int
            Nanoseconds; the second is the first where not given.
        data : bytes
            CDR.

        """
        sent = log_time if publish_time is None else publish_time
        if not (0 <= log_time < NEVER and 0 <= sent < NEVER):
            raise BagError(f'{self.folder}: a message of {topic} has a time before 1970 '
                           f'or after 2262: {log_time} ns')
        try:
            if self._is_full(log_time):
                self._finish_file()
                self._file = self._next_file()
            self._open_file().write(topic, log_time, data, sent)
        except OSError as error:
            raise self._failed(error) from None
        self.counts[topic] += 1

    def flush(self) -> None:
        """Write what there is to the disk: it survives the death of this process."""
        try:
            self._open_file().flush()
        except OSError as error:
            raise self._failed(error) from None
        self.saved = self.counts.total()

    def close(self) -> None:
        """
        Finish the bag; closing it again does nothing.

        Raises
        ------
        BagError
            If the disk is full: what was written before stays, unless the writer is atomic.

        """
        if self._file is None:
            return
        try:
            self._finish_file()
            write_metadata(self._place, self._files)
            if self._atomic:
                self._place.rename(self.folder)
        except OSError as error:
            raise self._failed(error) from None
        self._file = None
        self.saved = self.counts.total()

    def discard(self) -> None:
        """End without finishing: an atomic writer leaves nothing, another what was written."""
        if self._file is not None:
            self._file.abandon()
            self._file = None
        if self._atomic:
            shutil.rmtree(self._place, ignore_errors=True)

    @property
    def size(self) -> int:
        """Bytes written so far to the current file."""
        return self._file.size if self._file else 0

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if kind is not None and self._atomic:
            self.discard()
        else:
            self.close()

    def _next_file(self) -> McapFile:
        path = self._place / f'{self._name}_{len(self._files)}.mcap'
        file = McapFile(path, self._compression, self._chunk_size)
        file.note([*self._files, file.info])
        for topic in self.topics.values():
            file.add(topic)
        return file

    def _finish_file(self) -> None:
        file = self._open_file()
        self._files.append(file.info)
        file.note(self._files)
        file.finish()

    def _is_full(self, log_time: int) -> bool:
        file = self._open_file()
        if not file.info.counts:
            return False
        return (0 < self._max_size <= file.size
                or 0 < self._max_duration <= log_time - file.info.start)

    def _open_file(self) -> McapFile:
        if self._file is None:
            raise BagError(f'{self.folder}: is closed')
        return self._file

    def _failed(self, error: OSError) -> BagError:
        """Stop writing after an error of the disk and say what is left."""
        self.discard()
        saved = '' if self._atomic else (
            f"; what was written before is safe, 'deck_motion recover {self.folder}' opens it")
        return BagError(f'{self.folder}: cannot be written: {error.strerror}{saved}')
