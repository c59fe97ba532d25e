"""What every stream of stamped samples needs: the gate at its door and the schedule at its end."""

from __future__ import annotations

from deck_motion_ros.samples import NANOSECONDS, Rejected


class StampGate:
    """
    Admit the stamps of one topic in order and reject what cannot be.

    A stamp that is not newer than the newest one admitted, or that lies more than ``max_jump``
    ahead of it, is rejected. A clock that really was set anew is believed once ``confirm``
    rejected stamps in a row run on in order: the gate then reports a restart.

    Parameters
    ----------
    max_jump : float
        Seconds; longer silences need confirmation.
    confirm : int
        Number of stamps in a row.

    """

    __slots__ = ('newest', '_max_jump', '_confirm', '_suspect', '_run')

    def __init__(self, max_jump: float = 600.0, confirm: int = 10) -> None:
        self.newest: int | None = None
        self._max_jump = round(max_jump * NANOSECONDS)
        self._confirm = confirm
        self._suspect = 0
        self._run = 0

    def admit(self, stamp: int, others: int | None = None) -> bool:
        """
        Take a stamp (ns); return whether the clock was set anew with it.

        Parameters
        ----------
        stamp : int
            Nanoseconds.
        others : int or None
            The newest stamp of other topics, which a first stamp must not be far ahead of.

        Raises
        ------
        Rejected
            ``duplicate stamp``, ``older stamp`` or ``stamp far ahead``.

        """
        newest = self.newest
        reference = others if newest is None else newest
        in_order = newest is None or stamp > newest
        if in_order and (reference is None or stamp <= reference + self._max_jump):
            self.newest = stamp
            self._run = 0
            return False
        if stamp == newest:
            raise Rejected('duplicate stamp')
        runs_on = self._run > 0 and 0 < stamp - self._suspect <= self._max_jump
        self._run = self._run + 1 if runs_on else 1
        self._suspect = stamp
        if self._run >= self._confirm:
            self.newest = stamp
            self._run = 0
            return True
        raise Rejected('stamp far ahead' if in_order else 'older stamp')


class Rewind:
    """
    Notice a clock that was set back while only topics come that never came before.

    Their gates know no older stamp. What tells is that for ``patience`` seconds of stamps nothing
    is as new as the newest of all; a topic that merely lags behind a living one never gets there.

    Parameters
    ----------
    patience : float
        Seconds of stamps.

    """

    __slots__ = ('_patience', '_since', '_last')

    def __init__(self, patience: float = 10.0) -> None:
        self._patience = round(patience * NANOSECONDS)
        self._since: int | None = None
        self._last = 0

    def is_over(self, stamp: int, newest: int | None) -> bool:
        """Take a stamp and the newest of all before (ns); say whether the clock was set back."""
        if newest is None or stamp >= newest:
            self._since = None
            return False
        if self._since is None or abs(stamp - self._last) > self._patience:
            self._since = stamp
        self._last = stamp
        return stamp - self._since > self._patience


class OutputSchedule:
    """
    Thin outputs to at most one per period of stamp time.

    Output if stamp >= due - 0.1 period; then due += period. It restarts after a gap and never
    gives two outputs with one stamp.

    Parameters
    ----------
    rate : float
        Outputs per second of stamp time.

    """

    __slots__ = ('_period', '_slack', '_due', '_last')

    def __init__(self, rate: float) -> None:
        self._period = round(NANOSECONDS / rate)
        self._slack = self._period // 10
        self._due: int | None = None
        self._last: int | None = None

    def is_due(self, stamp: int) -> bool:
        """Say whether an output at ``stamp`` (ns) is due, without taking it."""
        if self._due is None or self._last is None:
            return True
        return stamp > self._last and stamp >= self._due - self._slack

    def take(self, stamp: int) -> None:
        """Note that the output at ``stamp`` (ns) has been made."""
        due = stamp if self._due is None else self._due
        due += self._period
        if due <= stamp:
            due = stamp + self._period
        self._due = due
        self._last = stamp
