"""One page that a ship's officer and an engineer both like to read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
import os
from pathlib import Path

from deck_motion_ros.evaluation.contents import Contents, read_contents
from deck_motion_ros.evaluation.report import bag as of_bag
from deck_motion_ros.evaluation.report.alignment import AlignmentView
from deck_motion_ros.evaluation.report.altitude import AltitudeView
from deck_motion_ros.evaluation.report.drawing import Clock
from deck_motion_ros.evaluation.report.guidance import GuidanceView
from deck_motion_ros.evaluation.report.landing import LandingView
from deck_motion_ros.evaluation.report.page import duration, moment, page, tiles_row
from deck_motion_ros.evaluation.report.predictor import PredictorView
from deck_motion_ros.evaluation.report.view import Chapter, Options, View
from deck_motion_ros.samples import Vector3

# in the order of their chapters
VIEWS: tuple[Callable[[Options], View], ...] = (
    PredictorView, AlignmentView, AltitudeView, LandingView, GuidanceView)


def write_report(bag: str | Path, html_path: str | Path, *, lever_arm: Vector3 | None = None,
                 warm_up: float | None = None, namespace: str | None = None,
                 remap: Sequence[str] = (), title: str = '') -> list[str]:
    """
    Write one self-contained HTML page about a bag.

    Parameters
    ----------
    bag, html_path : str or Path
        From where to where.
    lever_arm, warm_up : optional
        See :class:`Options`.
    namespace, remap
        See :func:`read_contents`.
    title : str
        Heading; the bag's name if empty.

    Returns
    -------
    list of str
        The headline in plain sentences.

    Raises
    ------
    ValueError
        If the bag cannot be read, its topics are ambiguous, or an option is not a number.
    OSError
        If the page cannot be written; nothing half-written stays behind.

    """
    if not all(map(isfinite, (*(lever_arm or ()), warm_up or 0.0))) or (warm_up or 0.0) < 0:
        raise ValueError('lever arm and warm-up must be numbers, the warm-up not below 0')
    views = [view(Options(lever_arm, warm_up)) for view in VIEWS]
    contents = read_contents(bag, views, namespace, remap)
    clock = Clock.of(*contents.span)
    chapters = [view.chapter(contents, clock) for view in views
                if not contents.held.keys().isdisjoint(view.subjects)]
    headline, text = _composed(contents, clock, chapters, title)
    path = Path(html_path)
    draft = path.with_name(f'.{path.name}.partial')
    try:
        draft.write_text(text, encoding='utf-8')
        os.replace(draft, path)
    except OSError as error:  # not that of the draft
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        draft.unlink(missing_ok=True)
    return headline


def _composed(contents: Contents, clock: Clock, chapters: Sequence[Chapter],
              title: str) -> tuple[list[str], str]:
    """Return the headline and the page; what could be judged leads."""
    start, end = contents.span
    length = duration(end - start)
    leading = sorted(chapters, key=lambda chapter: not chapter.tiles)
    headline = [sentence for chapter in leading for sentence in chapter.headline] or [
        f'{length} were recorded; the bag holds nothing that a report can judge.']
    return headline, page(
        title or contents.name, f'{moment(start)} · {length}', headline,
        [tiles_row(chapter.tiles) for chapter in leading],
        [of_bag.recorded(contents, [chapter.recorded for chapter in chapters]),
         *(part for chapter in chapters for part in chapter.sections),
         of_bag.gaps(contents, clock), of_bag.settings(contents)])
