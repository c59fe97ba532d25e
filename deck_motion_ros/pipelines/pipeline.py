"""What the pipelines of all nodes share: convert, count, warn, report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, ClassVar

from deck_motion_ros.messages import CONVERTERS, stamp_of, Types
from deck_motion_ros.samples import NANOSECONDS, Rejected
from deck_motion_ros.topics import BY_NAME, inputs

OK, WARN = 0, 1
LATEST = (2**31 - 60) * NANOSECONDS  # what is predicted needs a stamp, too
Status = tuple[str, int, str, dict[str, str]]


class Pipeline:
    """
    A node's estimator between its topics.

    Parameters
    ----------
    config : object
        Parameters of the node, of ``config_class``.
    types : Types
        Message classes of the outputs.
    warn : callable
        Takes each warning, once.

    Attributes
    ----------
    accepted : Counter
        Messages used, by topic.

    """

    node: ClassVar[str]
    config_class: ClassVar[type]

    def __init__(self, config: Any, types: Types, warn: Callable[[str], None]) -> None:
        self.config = config
        self._types = types
        self._warn = warn
        self._topics = tuple(topic.name for topic in inputs(self.node))
        self._converters = {
            name: CONVERTERS[BY_NAME[name].type] for name in self._topics}
        self._frames = {name: getattr(config, f'{BY_NAME[name].frame}_frame', None)
                        for name in self._topics}
        self.accepted: Counter[str] = Counter()
        self._rejected: Counter[str] = Counter()
        self._odd: Counter[str] = Counter()
        self._outputs = 0

    def take(self, topic: str, msg: Any) -> Iterator[tuple[str, Any]]:
        """
        Use one message of an input topic; give the (topic, message) pairs to publish, in order.

        A message that cannot be used is counted by its reason and warned of once per reason.
        """
        try:
            if stamp_of(msg) > LATEST:
                raise Rejected('implausible stamp')
            sample = self._converters[topic](msg)
            estimates = self._update(topic, sample)
        except Rejected as rejection:
            self._count(self._rejected, f'{topic}: {rejection.reason}', 'rejected')
            return
        self.accepted[topic] += 1
        expected = self._frames[topic]
        if expected is not None and sample.frame_id != expected:
            self._count(self._odd, f'{topic}: unexpected frame_id',
                        f"used; it is '{sample.frame_id}' where '{expected}' is expected")
        for estimate in estimates:
            self._outputs += 1
            yield from self._messages(estimate)

    def _update(self, topic: str, sample: Any) -> list[Any]:
        """Let the estimator use a sample; return its estimates or raise ``Rejected``."""
        raise NotImplementedError

    def _messages(self, estimate: Any) -> Iterator[tuple[str, Any]]:
        """Give the messages of one estimate."""
        raise NotImplementedError

    def close(self) -> None:
        """Keep what is to be kept beyond the end of the run."""

    def _state(self) -> tuple[int, str]:
        """Return level and one sentence: how the node is doing."""
        return (OK, 'estimating') if self._outputs else (WARN, 'no output yet')

    def _counts(self) -> dict[str, str]:
        """Return what else belongs beside the counts of messages, by name."""
        return {}

    def _statuses(self) -> list[Status]:
        """Return what there is to report besides input and settings."""
        return []

    def _count(self, counter: Counter[str], key: str, what: str) -> None:
        counter[key] += 1
        if counter[key] == 1:
            self._warn(f'{key} ({what}; counted from here on)')

    def diagnostics(self) -> list[Status]:
        """Report input, the estimator and settings as (name, level, message, values)."""
        level, text = self._state()
        rejected = sum(self._rejected.values())
        if level == OK and rejected:
            text += f', {rejected} messages rejected'
        values = {'outputs': str(self._outputs), **self._counts()}
        for word, counter in (('accepted', self.accepted), ('rejected', self._rejected),
                              ('odd', self._odd)):
            values |= {f'{word} {key}': str(count) for key, count in sorted(counter.items())}
        return [(f'{self.node}: input', level, text, values), *self._statuses(),
                (f'{self.node}: settings', OK, self.config.method, settings(self.config))]


def settings(config: Any) -> dict[str, str]:
    """
    Write a configuration as text by name; lists with ``', '`` between the elements.

    >>> from deck_motion_ros.estimators.touchdown import PredictorConfig
    >>> settings(PredictorConfig())['lever_arm']
    '-67.97, 3.05, 19.5'
    """
    values = {item.name: getattr(config, item.name) for item in fields(config)}
    return {name: ', '.join(map(str, value)) if isinstance(value, tuple) else str(value)
            for name, value in values.items()}
