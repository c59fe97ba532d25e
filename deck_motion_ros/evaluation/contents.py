"""What a bag holds, read once for everything that judges it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import struct
from typing import Any, Protocol
from zlib import crc32

from deck_motion_ros.evaluation.metrics import Regularity, regularity
from deck_motion_ros.names import absolute, remappings
from deck_motion_ros.recording import BagReader, BagTypes
from deck_motion_ros.samples import NANOSECONDS, Rejected
from deck_motion_ros.topics import BY_NAME, TOPICS

MOST_THINNED = 4000  # messages used of a topic that a reader thins: enough for every figure
SETTINGS = ': settings'  # ends the name of a status that states a node's parameters
FROM_OUTSIDE = tuple(topic for topic in TOPICS if topic.publisher in ('', 'simulator'))
SENSED = [topic.name for topic in FROM_OUTSIDE if topic.subscribers]
TRUTHS = [topic.name for topic in FROM_OUTSIDE if not topic.subscribers]

Handler = Callable[[int, Any], None]
Status = tuple[int, str, dict[str, str]]  # level, message, values


class Reader(Protocol):
    """
    What takes messages from a bag.

    Attributes
    ----------
    handlers : mapping of str to callable
        By topic name as in :mod:`deck_motion_ros.topics`: takes stamp (ns) and message, of the
        type stated there; raises ``Rejected`` where it cannot use the message.
    thinned : collection of str
        Those of which ``MOST_THINNED`` messages are enough, chosen alike by their stamps.

    """

    @property
    def handlers(self) -> Mapping[str, Handler]: ...

    @property
    def thinned(self) -> Collection[str]: ...


@dataclass(eq=False)
class Contents:
    """
    What a bag holds, whatever it is about.

    Attributes
    ----------
    name : str
        Of the bag.
    topics : dict of str to (str, Regularity)
        Type and stamps of every topic.
    held : dict of str to Regularity
        Stamps of the topics that a reader takes, by their name in this package.
    every : int
        One in so many messages of the thinned topics was used.
    settings : dict of str to dict
        What each node said of its parameters on ``/diagnostics``.
    states : dict of str to (int, str, dict)
        Last level, message and values of every other status, by its name.
    warned : Counter
        Statuses above level 0, by name.
    unusable : Counter
        Messages that could not be used here, by (topic, reason).

    """

    name: str
    topics: dict[str, tuple[str, Regularity]] = field(default_factory=dict)
    held: dict[str, Regularity] = field(default_factory=dict)
    every: int = 1
    settings: dict[str, dict[str, str]] = field(default_factory=dict)
    states: dict[str, Status] = field(default_factory=dict)
    warned: Counter[str] = field(default_factory=Counter)
    unusable: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def span(self) -> tuple[int, int]:
        """First and last stamp (ns) of what sensors measured, else of truths, of everything."""
        found = ([self.held[name] for name in SENSED if name in self.held]
                 or [self.held[name] for name in TRUTHS if name in self.held]
                 or [found for _, found in self.topics.values() if found.count])
        return min(item.first for item in found), max(item.last for item in found)

    def note(self, msg: Any) -> None:
        """Note what ``/diagnostics`` says."""
        for status in msg.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name.endswith(SETTINGS):
                self.settings[status.name.removesuffix(SETTINGS)] = values
            else:
                self.states[status.name] = (int(status.level), status.message, values)
            self.warned[status.name] += status.level > 0


def read_contents(bag: str | Path, readers: Sequence[Reader], namespace: str | None = None,
                  remap: Sequence[str] = ()) -> Contents:
    """
    Read a bag, giving each reader what it takes.

    Parameters
    ----------
    bag : str or Path
        The bag.
    readers : sequence of Reader
        Each gets the messages of its topics in the bag's order.
    namespace : str, optional
        Of those topics; needed only where a bag holds several.
    remap : sequence of str
        Rules ``old:=new`` for topics that go by other names.

    Raises
    ------
    BagError
        If the bag cannot be read.
    ValueError
        If the bag holds several namespaces and none is chosen, or a rule is wrong.

    """
    file = BagReader(bag)
    wanted = {name: [reader.handlers[name] for reader in readers if name in reader.handlers]
              for name in {name: None for reader in readers for name in reader.handlers}}
    if namespace is None:
        namespace = _namespace(list(file.topics), list(wanted))
    rules = remappings(remap, namespace)

    def resolved(ours: str) -> str:
        full = absolute(ours, namespace)
        return rules.get(full, full)

    ours = {resolved(name): name for name in wanted}
    thinned = {resolved(name) for reader in readers for name in reader.thinned}
    contents = Contents(file.path.resolve().name, every=1 + max(
        (file.counts.get(name, 0) for name in thinned), default=0) // MOST_THINNED)
    headed = {name for name, kind in file.topics.items() if _has_header(kind)}
    stamps: dict[str, list[int]] = {name: [] for name in file.topics}
    for topic, log_time, data in file.messages():
        stamp = _first_stamp(data) if topic in headed and len(data) >= 12 else log_time
        stamps[topic].append(stamp)
        name = ours.get(topic, topic)
        if name not in BY_NAME or (topic in thinned and crc32(data[4:12]) % contents.every):
            continue
        if file.topics[topic] != BY_NAME[name].type:
            contents.unusable[topic, f'not of type {BY_NAME[name].type}'] += 1
        elif name == '/diagnostics':
            msg = file.decode(topic, data)
            contents.note(msg)
            for handler in wanted.get(name, ()):
                handler(stamp, msg)
        elif name in wanted:
            msg = file.decode(topic, data)
            reasons = {_tried(handler, stamp, msg) for handler in wanted[name]}
            contents.unusable.update((topic, reason) for reason in reasons if reason)
    contents.topics = {name: (kind, regularity(stamps[name]))
                       for name, kind in sorted(file.topics.items())}
    contents.held = {name: contents.topics[topic][1] for topic, name in ours.items()
                     if stamps.get(topic) and file.topics[topic] == BY_NAME[name].type}
    return contents


def _tried(handler: Handler, stamp: int, msg: Any) -> str:
    """Let a handler use a message; return why it could not."""
    try:
        handler(stamp, msg)
    except Rejected as rejection:
        return rejection.reason
    return ''


def _namespace(names: list[str], wanted: list[str]) -> str:
    """Find the namespace of the topics: that of what nodes publish, else of what they use."""
    made = [ours for ours in wanted if BY_NAME[ours].publisher not in ('', 'simulator')]
    for chosen in (made, wanted):
        found = sorted({name.removesuffix(ours) for name in names for ours in chosen
                        if name.endswith(f'/{ours}')})
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"the bag holds the namespaces {', '.join(found)}: "
                             'choose one with --namespace')
    return '/'


def _has_header(kind: str) -> bool:
    try:
        return 'header' in BagTypes()[kind].__dataclass_fields__
    except KeyError:
        return False


def _first_stamp(data: bytes) -> int:
    """Read the header's stamp (ns) without decoding the message."""
    sec, nanosec = struct.unpack_from('<iI' if data[1] & 1 else '>iI', data, 4)
    return int(sec * NANOSECONDS + nanosec)
