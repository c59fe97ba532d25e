"""Long experiments on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from multiprocessing import get_context
import signal
from typing import TypeVar

T = TypeVar('T')


def results(tasks: Iterable[Callable[[], T]]) -> Iterator[T]:
    """Run tasks in fresh processes; give their results in order. Ctrl-C ends them all."""
    with get_context('spawn').Pool(
            initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)) as pool:
        yield from pool.imap(_result, tasks)


def _result(task: Callable[[], T]) -> T:
    return task()
