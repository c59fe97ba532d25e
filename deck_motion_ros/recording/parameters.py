"""Parameters of the recorder and the player, and the choice of topics."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
import re

from deck_motion_ros.config import parameter


@dataclass(frozen=True)
class RecorderConfig:
    """Parameters of the recorder."""

    output: str = parameter('', 'Folder of the bag; empty: rosbag2_ and the local time.')
    topics: tuple[str, ...] = parameter((), 'Topics to record; empty: all.')
    pattern: str = parameter('', 'Regular expression: record the topics it is found in too.')
    exclude: str = parameter('', 'Regular expression: leave out the topics it is found in.')
    max_duration: float = parameter(0.0, 'Begin a new file after this time; 0: never.', 's', 0.0)
    max_size: int = parameter(0, 'Begin a new file above this size; 0: never.', 'bytes', 0)
    compression: str = parameter('none', 'Compression of the chunks of a file.',
                                 choices=('none', 'zstd', 'lz4'))
    queue: int = parameter(5000, 'Messages per topic that may wait to be taken.', '', 1, 100_000)


@dataclass(frozen=True)
class PlayerConfig:
    """Parameters of the player."""

    bag: str = parameter('', 'Folder of the bag, or one MCAP file.')
    topics: tuple[str, ...] = parameter((), 'Topics to play; empty: all.')
    remap: tuple[str, ...] = parameter((), 'New topic names, each as old:=new.')
    rate: float = parameter(1.0, 'Speed; 0: as fast as max_rate allows.', 'bag s per s', 0.0)
    max_rate: float = parameter(2000.0, 'With rate 0: pace.', 'messages per s', 1.0)
    start: float = parameter(0.0, 'Begin this long after the first message.', 's', 0.0)
    loop: bool = parameter(False, 'Begin again at the end.')
    clock: float = parameter(0.0, 'Ticks of /clock per second of bag time; 0: none.', 'Hz', 0.0,
                             10_000.0)
    wait_for_subscribers: tuple[str, ...] = parameter(
        (), 'Topics that need a subscriber before the first message; empty: any one of them.')
    wait_timeout: float = parameter(10.0, 'Wait at most this long for them; 0: not at all.',
                                    's', 0.0)


class TopicChoice:
    """
    Say which topics to record.

    Parameters
    ----------
    topics : collection of str
        Absolute names.
    pattern, exclude : str
        Regular expressions, searched for anywhere in a name; ``''`` = none. Without ``topics``
        and ``pattern`` every topic is chosen that is not hidden (no part of its name begins with
        an underscore).

    Raises
    ------
    ValueError
        If an expression is wrong.

    """

    def __init__(self, topics: Collection[str] = (), pattern: str = '', exclude: str = '') -> None:
        self._topics = frozenset(topics)
        self._pattern = _compiled('pattern', pattern)
        self._exclude = _compiled('exclude', exclude)

    def __contains__(self, name: str) -> bool:
        if self._exclude and self._exclude.search(name):
            return False
        if name in self._topics:
            return True
        if self._pattern:
            return bool(self._pattern.search(name))
        return not self._topics and '/_' not in name


def _compiled(name: str, text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise ValueError(f"parameter '{name}' is not a regular expression: {error}") from None
