"""When to publish what: the schedule of a bag being played."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from math import inf
from typing import NamedTuple

from deck_motion_ros.recording.definitions import BagError
from deck_motion_ros.recording.parameters import PlayerConfig
from deck_motion_ros.recording.reading import BagReader
from deck_motion_ros.samples import NANOSECONDS, nanoseconds, seconds


class Event(NamedTuple):
    """
    One thing to publish.

    Attributes
    ----------
    due : int
        Nanoseconds after the start of playing.
    time : int
        Log time (ns).
    topic : str
        Name in the bag; ``''`` is a tick of ``/clock``.
    data : bytes
        CDR.

    """

    due: int
    time: int
    topic: str
    data: bytes


def schedule(bag: BagReader, topics: Collection[str], config: PlayerConfig) -> Iterator[Event]:
    """
    Yield what to publish in its order; without end if the bag is played in a loop.

    Times due are counted from the start, so errors of timers do not add up.

    Raises
    ------
    BagError
        If the bag ends before ``start``, or has nothing of these topics after it.

    """
    since = bag.start + nanoseconds(config.start)
    if since > bag.end:
        raise BagError(f"{bag.path}: parameter 'start' is {config.start:g} s, the bag is "
                       f'{seconds(bag.end - bag.start):g} s long')
    due, count = 0, 0
    while True:
        first, begun = None, due
        for time, topic, data in _with_ticks(bag, topics, since, config.clock):
            first = time if first is None else first
            if config.rate:
                due = begun + round((time - first) / config.rate)
            else:
                due = round(count / config.max_rate * NANOSECONDS)
            yield Event(due, time, topic, data)
            count += 1
        if first is None:
            raise BagError(f'{bag.path}: holds nothing to play')
        if not config.loop:
            return


def _with_ticks(bag: BagReader, topics: Collection[str], since: int,
                rate: float) -> Iterator[tuple[int, str, bytes]]:
    """Put ticks of the clock, from ``since`` on, before the messages of their time or later."""
    tick = since if rate else inf
    period = nanoseconds(1.0 / rate) if rate else 0
    for topic, time, data in bag.messages(topics, since):
        while tick <= time:
            yield int(tick), '', b''
            tick += period
        yield time, topic, data
