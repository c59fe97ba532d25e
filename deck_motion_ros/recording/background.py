"""A bag that is written in a thread of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from threading import Event, Thread
from typing import Any

from rosbags.interfaces import Qos

from deck_motion_ros.recording.definitions import BagError
from deck_motion_ros.recording.writing import BagWriter

FLUSH_PERIOD = 0.5  # s


class BackgroundWriter:
    """
    Queue messages and write them in a thread, with a flush twice a second.

    Neither a slow disk nor a signal at the wrong moment costs the caller a message: what is
    queued is written. Times are real here: this is for recorders, not for estimators.

    Parameters
    ----------
    bag : BagWriter
        The bag; nobody else may use it.

    Attributes
    ----------
    taken : int
        Messages queued so far.
    error : BagError or None
        Why writing has ended.

    """

    def __init__(self, bag: BagWriter) -> None:
        self.taken = 0
        self.error: BagError | None = None
        self._bag = bag
        self._queue: deque[Callable[[], object]] = deque()
        self._held: list[tuple[str, int, bytes, int]] = []
        self._ending = Event()
        self._thread = Thread(target=self._run, name='bag writer', daemon=True)
        self._thread.start()

    @property
    def saved(self) -> int:
        """Messages that are on the disk."""
        return self._bag.saved

    def add_topic(self, name: str, type_name: str, type_hash: str | None,
                  qos: Iterable[Qos]) -> None:
        """Queue :meth:`BagWriter.add_topic`."""
        self._queue.append(partial(self._bag.add_topic, name, type_name, type_hash=type_hash,
                                   qos=tuple(qos)))

    def write(self, topic: str, log_time: int, data: bytes, publish_time: int) -> None:
        """Queue :meth:`BagWriter.write`."""
        for name, _, *content in self._held:
            self._enter(name, log_time, *content)
        self._held.clear()
        self.taken += 1
        self._enter(topic, log_time, data, publish_time)

    def hold(self, topic: str, received: int, data: bytes, publish_time: int) -> None:
        """
        Keep a message that came before there was any simulated time.

        It gets the log time of the first that has one; if there never is, the time of its arrival.
        """
        self.taken += 1
        self._held.append((topic, received, data, publish_time))

    def close(self) -> None:
        """Write the rest and finish the bag; look at ``error`` afterwards."""
        for message in self._held:
            self._enter(*message)
        self._held.clear()
        self._ending.set()
        self._thread.join()

    def _enter(self, *message: Any) -> None:
        self._queue.append(partial(self._bag.write, *message))

    def _run(self) -> None:
        try:
            ending = False
            while not ending:
                ending = self._ending.wait(FLUSH_PERIOD)
                while self._queue:
                    self._queue.popleft()()
                self._bag.flush()
            self._bag.close()
        except BagError as error:
            self.error = error
        except Exception as error:  # a recording must not end in silence
            self._bag.discard()
            self.error = BagError(f'{self._bag.folder}: {type(error).__name__}: {error}')
