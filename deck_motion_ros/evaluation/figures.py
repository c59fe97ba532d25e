"""The report's figures, as SVG that lives inside the page: no fonts, no links, no scripts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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

from deck_motion_ros.evaluation.metrics import (
    Comparison,
    Regularity,
    rms,
    Series,
    spectrum,
    Stamps,
)
from deck_motion_ros.samples import Array, NANOSECONDS

# Okabe and Ito's colours, which colour-blind people tell apart
INK, QUIET, GRID = '#24292f', '#6e7781', '#e6e8eb'
BLUE, ORANGE, GREEN, SKY = '#0072b2', '#d55e00', '#00795a', '#a9d3ee'
AXIS_COLOURS = {'roll': BLUE, 'pitch': ORANGE, 'heave': GREEN}
AXIS_UNITS = {'roll': 'deg', 'pitch': 'deg', 'heave': 'm'}
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
class _Drawing:
    """A figure, and what it has become as SVG."""

    figure: Figure
    svg: str = ''


@contextmanager
def _drawing(height: float, description: str) -> Iterator[_Drawing]:
    """Open a figure as wide as the text; its SVG is there after the block."""
    with rc_context({**STYLE, 'svg.hashsalt': description}):
        drawing = _Drawing(Figure(figsize=(WIDE, height)))
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


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin a long line to the lowest and highest point of each of many short pieces."""
    if len(x) <= MOST_POINTS:
        return x, y
    pieces = np.array_split(np.arange(len(x)), MOST_POINTS // 2)
    keep = np.unique([piece[index] for piece in pieces
                      for index in (np.argmin(y[piece]), np.argmax(y[piece]))])
    return x[keep], y[keep]


def _line(axes: Axes, series: Series, clock: Clock, scale: float, **look: Any) -> None:
    """Draw a series with its gaps left open."""
    for number, run in enumerate(series.runs):
        x, y = _thinned(clock(series.stamps[run]), series.values[run] * scale)
        axes.plot(x, y, **{**look, 'label': look.get('label') if not number else None,
                           'marker': '.' if len(x) == 1 else None})


def motion(axes_by_name: dict[str, Series], clock: Clock) -> str:
    """Draw roll, pitch (degrees, pitch positive bow down) and heave over time."""
    with _drawing(1.45 * len(axes_by_name) + 0.45, 'Ship motion over time') as drawing:
        panels = drawing.figure.subplots(len(axes_by_name), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (name, series) in zip(panels, axes_by_name.items(), strict=True):
            _line(panel, series, clock, _scale(name), color=AXIS_COLOURS[name], linewidth=1)
            panel.set_ylabel(f'{name} ({AXIS_UNITS[name]})')
            panel.yaxis.set_major_locator(_ticks(4))
            panel.margins(x=0)
        panels[-1].set_xlabel(clock.label)
        drawing.figure.align_ylabels()
    return drawing.svg


def _scale(name: str) -> float:
    return 1.0 if AXIS_UNITS[name] == 'm' else float(np.degrees(1.0))


def forecast(whole: Comparison, reference: Series, clock: Clock, zoom: tuple[int, int] | None,
             judged_from: int, reference_name: str) -> str:
    """
    Draw forecast, its 95 % interval and what came: the whole run, and a part of it below.

    Parameters
    ----------
    whole : Comparison
        At the node's horizon.
    reference : Series
        Height that came (m).
    clock : Clock
        Time axis.
    zoom : tuple of 2 int, optional
        The part (ns).
    judged_from : int
        End of the warm-up (ns).
    reference_name : str
        ``measured`` or ``true``.

    """
    views = [(clock, (clock.start, int(whole.valid_at[-1])), 0.8 if zoom else 1.3)]
    if zoom:
        views.append((Clock(clock.start, 's'), zoom, 1.5))
    with _drawing(6.1 if zoom else 3.4, 'Forecast against what came') as drawing:
        panels = drawing.figure.subplots(
            len(views), 1, squeeze=False, height_ratios=(1, 1.5)[:len(views)])[:, 0]
        for panel, (time, (start, end), weight) in zip(panels, views, strict=True):
            shown = whole.where((whole.valid_at >= start) & (whole.valid_at <= end))
            shown = shown.where(np.arange(len(shown)) % (1 + len(shown) // MOST_POINTS) == 0)
            x, half = time(shown.valid_at), 1.96 * shown.sd
            panel.fill_between(x, shown.mean - half, shown.mean + half, color=SKY, alpha=0.55,
                               linewidth=0, label='95 % interval stated')
            panel.plot(x, shown.mean, color=BLUE, linewidth=weight,
                       label=f'forecast {whole.horizon:g} s before')
            near = (reference.stamps >= start) & (reference.stamps <= end)
            came = Series(reference.stamps[near], reference.values[near])
            _line(panel, came, time, 1.0, color=INK, linewidth=0.8 * weight, label=reference_name)
            if len(came) < 200:
                panel.plot(time(came.stamps), came.values, '.', color=INK, markersize=4)
            panel.set(ylabel='height (m)', xlabel=time.label, xlim=time(np.array([start, end])),
                      ylim=_range(shown, came.values))
            panel.yaxis.set_major_locator(_ticks(5))
        over = panels[0]
        if zoom:
            over.axvspan(*clock(np.array(zoom)), color=ORANGE, alpha=0.13, linewidth=0)
        over.axvline(float(clock(judged_from)), color=QUIET, linewidth=0.9, linestyle=(0, (4, 3)))
        over.legend(ncols=3, loc='lower center', bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
        drawing.figure.align_ylabels()
    return drawing.svg


def _range(shown: Comparison, came: Array) -> tuple[float, float]:
    """Choose limits for what came and what was forecast; a wild band may leave the picture."""
    values = np.concatenate([came, shown.mean])
    half = 1.96 * float(np.nanmedian(shown.sd)) if np.isfinite(shown.sd).any() else 0.0
    low, high = float(np.min(values)), float(np.max(values))
    edge = min(half, high - low) + 0.05 * (high - low) + 1e-6
    return low - edge, high + edge


def error_by_horizon(comparisons: Sequence[Comparison], horizon: float) -> str:
    """Draw the error (m) over the horizon for the forecast and the two simple answers."""
    ahead = [comparison.horizon for comparison in comparisons]
    lines = (
        ('it stays as it is', [item.persistence for item in comparisons], ORANGE, '-'),
        ('it is at rest', [item.zero for item in comparisons], QUIET, (0, (5, 3))),
        ('forecast', [item.rmse for item in comparisons], BLUE, '-'),
        ('what the forecast says of itself', [_stated(item) for item in comparisons], BLUE,
         (0, (1, 2))))
    with _drawing(3.5, 'Error by horizon') as drawing:
        panel = drawing.figure.subplots()
        for label, values, colour, style in lines:
            panel.plot(ahead, values, color=colour, linestyle=style, label=label,
                       linewidth=2 if label == 'forecast' else 1.5)
        panel.axvline(horizon, color=GRID, linewidth=6, zorder=0)
        panel.set_xlim(0, max(ahead))
        panel.set_ylim(0, 1.12 * max(value for _, values, *_ in lines[:3] for value in values))
        panel.set_xlabel('seconds ahead')
        panel.set_ylabel('error, RMS (m)')
        panel.legend(ncols=4, loc='lower center', bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
    return drawing.svg


def _stated(comparison: Comparison) -> float:
    return rms(comparison.sd[np.isfinite(comparison.sd)])


def calibration(comparison: Comparison) -> str:
    """Draw how often what came lay inside each interval, and the errors over their sd."""
    levels = np.linspace(0.05, 0.99, 20)
    with _drawing(3.4, 'Calibration') as drawing:
        left, right = drawing.figure.subplots(1, 2)
        left.plot([0, 100], [0, 100], color=QUIET, linestyle=(0, (5, 3)), linewidth=1.2,
                  label='honest')
        left.plot(100 * levels, [100 * comparison.coverage(level) for level in levels.tolist()],
                  color=BLUE, linewidth=2, label='this forecast')
        for level in (0.6827, 0.95):
            left.plot(100 * level, 100 * comparison.coverage(level), 'o', color=BLUE, markersize=5)
        left.set(xlim=(0, 100), ylim=(0, 100), xlabel='interval stated (%)',
                 ylabel='what came lay inside (%)')
        left.legend(loc='upper left')
        edges = np.linspace(-4, 4, 33)
        errors = np.clip(comparison.normalised, -4, 4)
        right.hist(errors, edges.tolist(), density=True, color=SKY)
        curve = np.linspace(-4, 4, 161)
        right.plot(curve, np.exp(-curve**2 / 2) / np.sqrt(2 * np.pi), color=QUIET,
                   linestyle=(0, (5, 3)), linewidth=1.2, label='honest')
        right.set(xlim=(-4, 4), xlabel='error / stated standard deviation', ylabel='density')
        right.yaxis.set_major_locator(_ticks(4))
        right.legend(loc='upper left')
    return drawing.svg


def spectra(axes_by_name: dict[str, Series]) -> str:
    """Draw the spectra of roll, pitch and heave, up to where nearly all energy lies."""
    found = {name: spectrum(series) for name, series in axes_by_name.items()}
    found = {name: (frequency, density) for name, (frequency, density) in found.items()
             if density.any()}
    if not found:
        return ''
    edge = max(_edge(*pair) for pair in found.values())
    with _drawing(2.9, 'Spectra') as drawing:
        panels = drawing.figure.subplots(1, len(found), squeeze=False)[0]
        for panel, (name, (frequency, density)) in zip(panels, found.items(), strict=True):
            unit, scale = AXIS_UNITS[name], _scale(name)**2
            panel.fill_between(frequency, scale * density, color=AXIS_COLOURS[name], alpha=0.15,
                               linewidth=0)
            panel.plot(frequency, scale * density, color=AXIS_COLOURS[name], linewidth=1.5)
            panel.set(xlim=(0, edge), xlabel='frequency (Hz)', ylabel=f'{name} ({unit}²/Hz)')
            panel.set_ylim(bottom=0)
            panel.xaxis.set_major_locator(_ticks(4))
            panel.yaxis.set_major_locator(_ticks(4))
    return drawing.svg


def _edge(frequency: Array, density: Array) -> float:
    """Find a frequency that has 99.5 % of the energy below it, with room to the right."""
    share = np.cumsum(density) / np.sum(density)
    enough = 1.3 * frequency[np.searchsorted(share, 0.995)]
    return float(min(max(enough, 0.25), frequency[-1], 2.0))


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
    with _drawing(0.32 * len(topics) + 0.75, 'When each topic was there') as drawing:
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


def _ticks(count: int) -> MaxNLocator:
    return MaxNLocator(count, steps=[1, 2, 2.5, 5, 10])


