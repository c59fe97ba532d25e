"""Messages that never came, known by the gaps between those that did."""

from __future__ import annotations

from collections import Counter


class SequenceGaps:
    """
    Count missing messages by the sequence numbers that publishers give theirs.

    Numbers that run backwards mean a second publisher or a new one: such a topic is not judged
    any more.

    Attributes
    ----------
    missing : Counter
        Missing messages by topic.

    """

    def __init__(self) -> None:
        self.missing: Counter[str] = Counter()
        self._newest: dict[str, int] = {}
        self._mixed: set[str] = set()

    def note(self, topic: str, number: int | None) -> None:
        """Take the number of a message; None = the middleware has none."""
        if number is None or topic in self._mixed:
            return
        newest = self._newest.get(topic, number - 1)
        if number <= newest:
            self._mixed.add(topic)
            self.missing.pop(topic, None)
            return
        if number > newest + 1:
            self.missing[topic] += number - newest - 1
        self._newest[topic] = number
