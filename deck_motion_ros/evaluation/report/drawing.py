"""Figures as SVG that lives inside the page: no fonts, no links, no scripts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import StringIO
import re
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from deck_motion_ros.evaluation.metrics import Regularity, Series, Stamps
from deck_motion_ros.samples import Array, NANOSECONDS

# Okabe and Ito's colours, which colour-blind people tell apart
INK, QUIET, GRID = '#24292f', '#6e7781', '#e6e8eb'
BLUE, ORANGE, GREEN, SKY = '#0072b2', '#d55e00', '#00795a', '#a9d3ee'
WIDE = 9.6  # inches at 100 per inch: the width of the text
MOST_POINTS = 3000

STYLE: dict[Any, Any] = {
    'svg.fonttype': 'none', 'font.size': 10.5, 'axes.labelsize': 10.5, 'axes.edgecolor': '#b6bcc3',
    'axes.linewidth': 0.8, 'axes.labelcolor': INK, 'axes.spines.top': False,
    'axes.spines.right': False, 'axes.grid': True, 'axes.axisbelow': True, 'grid.color': GRID,
    'grid.linewidth': 0.8, 'xtick.color': QUIET, 'ytick.color': QUIET, 'xtick.labelcolor': INK,
    'ytick.labelcolor': INK, 'xtick.major.size': 3, 'ytick.major.size': 0, 'lines.linewidth': 1.3,
    'legend.frameon': False, 'legend.fontsize': 10, 'figure.facecolor': 'none',
    'axes.facecolor': 'none', 'savefig.facecolor': 'none', 'text.color': INK,
    'figure.constrained_layout.use': True,
}


@dataclass(frozen=True)
class Clock:
    """
    The time axis of a record: since its start, in a unit that suits its length.

    Attributes
    ----------
    start : int
        Nanoseconds.
    unit : str
        ``s``, ``min`` or ``h``.

    """

    start: int
    unit: str

    @classmethod
    def of(cls, start: int, end: int) -> Clock:
        """Choose the unit."""
        length = (end - start) / NANOSECONDS
        return cls(start, 's' if length <= 300 else 'min' if length <= 3 * 3600 else 'h')

    def __call__(self, stamps: Stamps | int) -> Array:
        """Convert stamps (ns)."""
        scale = {'s': 1, 'min': 60, 'h': 3600}[self.unit]
        return np.asarray((np.asarray(stamps) - self.start) / (scale * NANOSECONDS))

    @property
    def label(self) -> str:
        """Name the axis."""
        return f'time since the start ({self.unit})'


@dataclass
class Drawing:
    """A figure, and what it has become as SVG."""

    figure: Figure
    svg: str = ''


@contextmanager
def canvas(height: float, description: str) -> Iterator[Drawing]:
    """
    Open a figure as wide as the text; its SVG is there after the block.

    ``description`` must be the only one of its kind on the page: ids are made of it.
    """
    with rc_context({**STYLE, 'svg.hashsalt': description}):
        drawing = Drawing(Figure(figsize=(WIDE, height)))
        yield drawing
        text = StringIO()
        drawing.figure.savefig(text, format='svg', metadata=dict.fromkeys(
            ('Date', 'Creator', 'Format', 'Type')))
    drawing.svg = _inline(text.getvalue(), description)


def _inline(svg: str, description: str) -> str:
    svg = svg[svg.index('<svg'):]  # the page's fonts, no ids twice, no addresses
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', '<g', svg)
    svg = re.sub(r'\bfont: ([\d.]+px)[^;"]*', r'font-size: \1', svg)
    width, height = re.findall(r'(?:width|height)="([\d.]+)pt"', svg)[:2]
    return re.sub(r'<svg[^>]*>', f'<svg viewBox="0 0 {width} {height}" role="img" '
                  f'aria-label="{description}">', svg, count=1)


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin a long line to the lowest and highest point of each of many short pieces."""
    if len(x) <= MOST_POINTS:
        return x, y
    pieces = np.array_split(np.arange(len(x)), MOST_POINTS // 2)
    keep = np.unique([piece[index] for piece in pieces
                      for index in (np.argmin(y[piece]), np.argmax(y[piece]))])
    return x[keep], y[keep]


def line(axes: Axes, series: Series, clock: Clock, scale: float, **look: Any) -> None:
    """Draw a series with its gaps left open."""
    for number, run in enumerate(series.runs):
        x, y = thinned(clock(series.stamps[run]), series.values[run] * scale)
        axes.plot(x, y, **{**look, 'label': look.get('label') if not number else None,
                           'marker': '.' if len(x) == 1 else None})


def presence(topics: Mapping[str, Regularity], clock: Clock) -> str:
    """
    Draw when each topic was there: a bar with its gaps.

    Parameters
    ----------
    topics : mapping of str to Regularity
        Stamps by topic.
    clock : Clock
        Time axis.

    """
    with canvas(0.32 * len(topics) + 0.75, 'When each topic was there') as drawing:
        panel = drawing.figure.subplots()
        for row, found in enumerate(topics.values()):
            bars = [(found.first, found.last, SKY)] + [
                (stamp, stamp + round(length * NANOSECONDS), ORANGE)
                for stamp, length in found.gaps]
            for first, last, colour in bars:
                begin, end = clock(np.array([first, last])).tolist()
                panel.barh(row, end - begin, left=begin, height=0.5, color=colour,
                           edgecolor=colour, linewidth=0.8)
        panel.set_yticks(range(len(topics)), list(topics))
        panel.invert_yaxis()
        panel.grid(False, axis='y')
        panel.spines['left'].set_visible(False)
        panel.margins(x=0)
        panel.set_xlabel(clock.label)
    return drawing.svg


def ticks(count: int) -> MaxNLocator:
    """Place at most so many ticks at round numbers."""
    return MaxNLocator(count, steps=[1, 2, 2.5, 5, 10])
