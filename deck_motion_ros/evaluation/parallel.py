"""Long experiments on all cores."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import signal


def workers() -> ProcessPoolExecutor:
    """Return fresh processes, one for each core, that Ctrl-C ends at once."""
    return ProcessPoolExecutor(mp_context=get_context('spawn'), initializer=signal.signal,
                               initargs=(signal.SIGINT, signal.SIG_DFL))
