"""Repair of a bag whose recorder was killed or whose disk was full."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from deck_motion_ros.recording.definitions import BagError, BagTopic
from deck_motion_ros.recording.metadata import FileInfo, write_metadata
from deck_motion_ros.recording.reading import described_files, in_order
from deck_motion_ros.recording.records import is_whole, read_chunk, read_index, salvage
from deck_motion_ros.recording.writing import McapFile

DAMAGED = '.damaged'


@dataclass(frozen=True)
class Recovered:
    """
    What a bag holds after :func:`recover`.

    Attributes
    ----------
    repaired : tuple of Path
        Files written anew.
    kept : tuple of Path
        Where the damaged originals are now.
    counts : dict of str to int
        Messages by topic, of the whole bag.
    described : bool
        Whether ``metadata.yaml`` was written.

    """

    repaired: tuple[Path, ...]
    kept: tuple[Path, ...]
    counts: dict[str, int]
    described: bool

    @property
    def messages(self) -> int:
        """Number of messages of the whole bag."""
        return sum(self.counts.values())

    def __str__(self) -> str:
        what = f'{self.messages} messages of {len(self.counts)} topics'
        done = [f'{new} repaired, the original is {old.name}'
                for new, old in zip(self.repaired, self.kept, strict=True)]
        done += ['metadata.yaml written'] * self.described
        return '; '.join([what, *(done or ['nothing to repair'])])


def recover(folder: str | Path) -> Recovered:
    """
    Repair a bag in place; a healthy one is left as it is.

    Every file that is cut off is written anew up to its last complete message, also within an
    unfinished chunk, and one with a damaged chunk without that; the original stays as
    ``NAME_0.mcap.damaged``. A missing ``metadata.yaml`` is written. What an interrupted repair
    left is taken up again.

    Parameters
    ----------
    folder : str or Path
        A bag's folder, or one MCAP file (then only that).

    Raises
    ------
    BagError
        If there is no MCAP bag, or it cannot be written.

    """
    path = Path(folder)
    if path.is_dir():
        originals = (item.with_suffix('') for item in path.glob(f'*.mcap{DAMAGED}'))
        files = in_order({*path.glob('*.mcap'), *originals})
    else:
        files = [path] if path.suffix == '.mcap' and path.exists() else []
    if not files:
        raise BagError(f'{path}: ' + ('no MCAP file here' if path.exists() else 'does not exist'))
    try:
        checked = [_repair(file) for file in files]
        repaired = tuple(info.path for info, is_new in checked if is_new)
        describe = path.is_dir() and bool(
            repaired or _described(path) != [file.name for file in files])
        if describe:
            write_metadata(path, [info for info, _ in checked])
    except OSError as error:
        raise BagError(f'{path}: cannot be repaired: {error.strerror}') from None
    counts = sum((info.counts for info, _ in checked), Counter[str]())
    return Recovered(repaired, tuple(map(_original, repaired)), dict(counts), describe)


def _described(folder: Path) -> list[str] | None:
    try:
        return described_files(folder)
    except BagError:
        return None


def _original(path: Path) -> Path:
    return path.with_name(path.name + DAMAGED)


def _repair(path: Path) -> tuple[FileInfo, bool]:
    """Return what a file holds and whether it had to be written anew."""
    original = _original(path)
    healthy = _healthy(path) if path.exists() else None
    if healthy is not None:
        return healthy, False
    if not original.exists():
        path.rename(original)
    path.unlink(missing_ok=True)  # an interrupted repair
    try:
        return _rewrite(original, path), True
    except OSError:
        path.unlink(missing_ok=True)
        original.rename(path)
        raise


def _healthy(path: Path) -> FileInfo | None:
    if not is_whole(path):
        return None
    try:
        index = read_index(path)
        for place in index[1] if index is not None else ():
            read_chunk(place)
    except BagError:
        return None
    return index[0] if index is not None else None


def _rewrite(source: Path, target: Path) -> FileInfo:
    topics: dict[int, BagTopic] = {}
    file = McapFile(target)

    def add_found() -> None:
        for topic in topics.values():
            if topic.name not in file.info.topics:
                file.add(topic)

    try:
        for log_time, name, publish_time, data in salvage(source, topics):
            if name not in file.info.topics:
                add_found()
            file.write(name, log_time, data, publish_time)
        add_found()
        file.note([file.info])
        file.finish()
    finally:
        file.abandon()
    return file.info
