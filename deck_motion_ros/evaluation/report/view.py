"""What a view of a bag is: the topics it reads, and the chapter it makes of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

from deck_motion_ros.evaluation.contents import Contents, Reader
from deck_motion_ros.evaluation.report.drawing import Clock
from deck_motion_ros.evaluation.report.page import Tile
from deck_motion_ros.samples import Vector3


@dataclass(frozen=True, slots=True)
class Options:
    """
    What whoever asks for a report may say.

    Attributes
    ----------
    lever_arm : tuple of 3 float or None
        The touchdown point in ship axes (m), where the bag does not state it.
    warm_up : float or None
        Seconds at the start that are not judged.

    """

    lever_arm: Vector3 | None = None
    warm_up: float | None = None


@dataclass(frozen=True, slots=True)
class Chapter:
    """
    What a view says of a bag.

    Attributes
    ----------
    recorded : str
        What the bag holds of it: plain text below "What was recorded".
    headline : sequence of str
        Plain sentences, the most important first.
    tiles : sequence of (id, number, what it is)
        At most five; the ids are unique on the page; none if nothing could be judged.
    sections : sequence of str
        Made by :func:`deck_motion_ros.evaluation.report.page.section`; empty ones are left out.

    """

    recorded: str
    headline: Sequence[str]
    tiles: Sequence[Tile]
    sections: Sequence[str]


class View(Reader, Protocol):
    """
    One subject of a report, made for one bag.

    Attributes
    ----------
    subjects : collection of str
        The view is shown if the bag holds one of these topics.

    """

    @property
    def subjects(self) -> Collection[str]: ...

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say what the bag shows, once its messages were read."""
