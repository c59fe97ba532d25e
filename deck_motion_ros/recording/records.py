"""The records of one MCAP file, whole or cut off: what reading and repairing share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import BytesIO
import mmap
from pathlib import Path
import struct
from typing import NamedTuple
import zlib

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos
import zstandard

from deck_motion_ros.recording.definitions import BagError, BagTopic
from deck_motion_ros.recording.metadata import FileInfo

MAGIC = b'\x89MCAP0\r\n'
FOOTER = 9 + 20 + len(MAGIC)
BROKEN = (McapError, struct.error, ValueError, KeyError, AssertionError,
          zstandard.ZstdError, RuntimeError)

_record = struct.Struct('<BQ')
_message = struct.Struct('<HIQQ')
_chunk = struct.Struct('<QQQII')

Record = tuple[int, str, int, bytes]  # log time, topic, publish time, CDR


class ChunkPlace(NamedTuple):
    """Where a chunk lies: first and last log time (ns), file, offset and length of its record."""

    start: int
    end: int
    path: Path
    offset: int
    length: int
    topics: Mapping[int, str]


def is_whole(path: Path) -> bool:
    """
    Say whether a file ends as a finished MCAP file does.

    Raises
    ------
    BagError
        If it is no MCAP file at all.

    """
    with path.open('rb') as file:
        head = file.read(len(MAGIC))
        size = file.seek(0, 2)
        if head != MAGIC[:len(head)]:
            raise BagError(f'{path}: not an MCAP file')
        file.seek(max(size - FOOTER, 0))
        tail = file.read()
    return size > FOOTER and tail[0] == Opcode.FOOTER and tail.endswith(MAGIC)


def read_index(path: Path) -> tuple[FileInfo, list[ChunkPlace]] | None:
    """
    Read what the summary of a finished file says: its contents and where its chunks lie.

    Returns
    -------
    FileInfo and list of ChunkPlace, or None
        ``None`` if the file has messages but no index of them.

    Raises
    ------
    BagError
        If the summary is damaged.

    """
    try:
        with path.open('rb') as file:
            summary = make_reader(file).get_summary()
        if summary is None or summary.statistics is None:
            return None
        return _indexed(path, summary)
    except BROKEN as error:
        raise BagError(f'{path}: its index is damaged ({error})') from None


def _indexed(path: Path, summary: Summary) -> tuple[FileInfo, list[ChunkPlace]] | None:
    statistics = summary.statistics
    assert statistics is not None
    if statistics.message_count and not (summary.chunk_indexes and summary.channels):
        return None
    info = FileInfo(path)
    for number, channel in summary.channels.items():
        topic = bag_topic(channel, summary.schemas.get(channel.schema_id))
        info.topics[topic.name] = topic
        info.counts[topic.name] += statistics.channel_message_counts.get(number, 0)
    if statistics.message_count:
        info.start, info.end = statistics.message_start_time, statistics.message_end_time
    names = {number: channel.topic for number, channel in summary.channels.items()}
    return info, [
        ChunkPlace(chunk.message_start_time, chunk.message_end_time, path,
                   chunk.chunk_start_offset, chunk.chunk_length, names)
        for chunk in summary.chunk_indexes]


def read_chunk(place: ChunkPlace) -> list[Record]:
    """
    Read the messages of one chunk in the order of the file.

    Raises
    ------
    BagError
        If the chunk is damaged.

    """
    with place.path.open('rb') as file:
        file.seek(place.offset)
        record = file.read(place.length)
    try:
        if record[0] != Opcode.CHUNK or len(record) != place.length:
            raise ValueError('no chunk where the index says')
        data = _unpacked(record, 9, len(record), strict=True)
    except BROKEN as error:
        raise BagError(f'{place.path}: damaged at byte {place.offset} ({error})') from None
    topics = place.topics
    found = []
    for opcode, begin, end in records(data):
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, publish_time = _message.unpack_from(data, begin)
            if channel in topics:
                found.append((log_time, topics[channel], publish_time, data[begin + 22:end]))
    return found


def records(data: bytes | mmap.mmap, begin: int = 0) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of each record's content, as far as they are complete."""
    size = len(data)
    while begin + 9 <= size:
        opcode, length = _record.unpack_from(data, begin)
        begin += 9
        if opcode == 0 or begin + length > size:
            return
        yield opcode, begin, begin + length
        begin += length


def salvage(path: Path, topics: dict[int, BagTopic]) -> Iterator[Record]:
    """
    Yield every message of a file, whole or not, up to where it is cut off.

    A chunk that was being written gives the messages that are complete in it; a chunk whose
    content is damaged is passed over.

    Parameters
    ----------
    path : Path
        The file.
    topics : dict of int to BagTopic
        Is filled with the topics found, by channel number.

    """
    if path.stat().st_size <= len(MAGIC):
        return
    schemas: dict[int, Schema] = {}
    with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        end = len(MAGIC)
        for opcode, begin, end in records(data, len(MAGIC)):  # noqa: B020
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return
            if opcode == Opcode.CHUNK:
                yield from _salvage_chunk(data, begin, end, schemas, topics)
            else:
                yield from _taken(opcode, data[begin:end], schemas, topics)
        if end + 9 <= len(data) and data[end] == Opcode.CHUNK:
            yield from _salvage_chunk(data, end + 9, len(data), schemas, topics)


def _salvage_chunk(data: mmap.mmap, begin: int, end: int, schemas: dict[int, Schema],
                   topics: dict[int, BagTopic]) -> Iterator[Record]:
    try:
        inside = _unpacked(data, begin, end, strict=False)
    except BROKEN:
        return
    for opcode, first, last in records(inside):
        yield from _taken(opcode, inside[first:last], schemas, topics)


def _taken(opcode: int, content: bytes, schemas: dict[int, Schema],
           topics: dict[int, BagTopic]) -> Iterator[Record]:
    try:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(content)))
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(content)))
            topics[channel.id] = bag_topic(channel, schemas.get(channel.schema_id))
        elif opcode == Opcode.MESSAGE:
            number, _, log_time, publish_time = _message.unpack_from(content)
            if number in topics:
                yield log_time, topics[number].name, publish_time, content[22:]
    except BROKEN:
        return


def _unpacked(data: bytes | mmap.mmap, begin: int, end: int, strict: bool) -> bytes:
    """Return the records inside a chunk; of a chunk that is cut off, its beginning."""
    _, _, size, checksum, length = _chunk.unpack_from(data, begin)
    begin += _chunk.size
    compression = bytes(data[begin:begin + length]).decode()
    content = bytes(data[begin + length + 8:end])
    if compression == 'zstd':
        content = zstandard.ZstdDecompressor().decompressobj().decompress(content)
    elif compression == 'lz4':
        content = LZ4FrameDecompressor().decompress(content)
    elif compression:
        raise ValueError(f'unknown compression {compression}')
    complete = len(content) == size
    if strict and not complete:
        raise ValueError('chunk is incomplete')
    if complete and checksum and zlib.crc32(content) != checksum:
        raise ValueError('checksum of the chunk is wrong')
    return content


def bag_topic(channel: Channel, schema: Schema | None) -> BagTopic:
    """Return what a channel and its schema say of a topic."""
    known = schema is not None and schema.encoding == 'ros2msg'
    try:
        qos = tuple(parse_qos(channel.metadata.get('offered_qos_profiles', '')))
    except (ReaderError, KeyError, TypeError):
        qos = ()
    return BagTopic(
        name=channel.topic,
        type=schema.name if schema else '',
        definition=schema.data.decode(errors='replace') if schema and known else '',
        type_hash=channel.metadata.get('topic_type_hash', ''),
        qos=qos)
