"""The figures of the predictor's chapter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deck_motion_ros.evaluation.metrics import Comparison, rms, Series, spectrum
from deck_motion_ros.evaluation.report.drawing import (
    BLUE,
    canvas,
    Clock,
    GREEN,
    GRID,
    INK,
    line,
    MOST_POINTS,
    ORANGE,
    QUIET,
    SKY,
    ticks,
)
from deck_motion_ros.samples import Array

AXIS_COLOURS = {'roll': BLUE, 'pitch': ORANGE, 'heave': GREEN}
AXIS_UNITS = {'roll': 'deg', 'pitch': 'deg', 'heave': 'm'}


def motion(axes_by_name: dict[str, Series], clock: Clock) -> str:
    """Draw roll, pitch (degrees, pitch positive bow down) and heave over time."""
    with canvas(1.45 * len(axes_by_name) + 0.45, 'Ship motion over time') as drawing:
        panels = drawing.figure.subplots(len(axes_by_name), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (name, series) in zip(panels, axes_by_name.items(), strict=True):
            line(panel, series, clock, _scale(name), color=AXIS_COLOURS[name], linewidth=1)
            panel.set_ylabel(f'{name} ({AXIS_UNITS[name]})')
            panel.yaxis.set_major_locator(ticks(4))
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
    with canvas(6.1 if zoom else 3.4, 'Forecast against what came') as drawing:
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
            line(panel, came, time, 1.0, color=INK, linewidth=0.8 * weight, label=reference_name)
            if len(came) < 200:
                panel.plot(time(came.stamps), came.values, '.', color=INK, markersize=4)
            panel.set(ylabel='height (m)', xlabel=time.label, xlim=time(np.array([start, end])),
                      ylim=_range(shown, came.values))
            panel.yaxis.set_major_locator(ticks(5))
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


def error_by_horizon(comparisons: Sequence[Comparison], floor: Array, horizon: float) -> str:
    """Draw the error (m) over the horizon: forecast, simple answers, floor (NaN: not known)."""
    ahead = [comparison.horizon for comparison in comparisons]
    lines = (
        ('it stays as it is', [item.persistence for item in comparisons], ORANGE, '-'),
        ('it is at rest', [item.zero for item in comparisons], QUIET, (0, (5, 3))),
        ('forecast', [item.rmse for item in comparisons], BLUE, '-'),
        ('what it says of itself', [_stated(item) for item in comparisons], BLUE,
         (0, (1, 2))),
        ('floor, estimated', floor.tolist(), GREEN, (0, (4, 2, 1, 2))))
    known = lines if np.isfinite(floor).any() else lines[:-1]
    with canvas(3.5, 'Error by horizon') as drawing:
        panel = drawing.figure.subplots()
        for label, values, colour, style in known:
            panel.plot(ahead, values, color=colour, linestyle=style, label=label,
                       linewidth=2 if label == 'forecast' else 1.5)
        panel.axvline(horizon, color=GRID, linewidth=6, zorder=0)
        panel.set_xlim(0, max(ahead))
        panel.set_ylim(0, 1.12 * max(value for _, values, *_ in lines[:3] for value in values))
        panel.set_xlabel('seconds ahead')
        panel.set_ylabel('error, RMS (m)')
        panel.legend(ncols=len(known), loc='lower center', bbox_to_anchor=(0.5, 1.0),
                     borderaxespad=0.1)
    return drawing.svg


def _stated(comparison: Comparison) -> float:
    return rms(comparison.sd[np.isfinite(comparison.sd)])


def calibration(comparison: Comparison) -> str:
    """Draw how often what came lay inside each interval, and the errors over their sd."""
    levels = np.linspace(0.05, 0.99, 20)
    with canvas(3.4, 'Calibration') as drawing:
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
        right.yaxis.set_major_locator(ticks(4))
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
    with canvas(2.9, 'Spectra') as drawing:
        panels = drawing.figure.subplots(1, len(found), squeeze=False)[0]
        for panel, (name, (frequency, density)) in zip(panels, found.items(), strict=True):
            unit, scale = AXIS_UNITS[name], _scale(name)**2
            panel.fill_between(frequency, scale * density, color=AXIS_COLOURS[name], alpha=0.15,
                               linewidth=0)
            panel.plot(frequency, scale * density, color=AXIS_COLOURS[name], linewidth=1.5)
            panel.set(xlim=(0, edge), xlabel='frequency (Hz)', ylabel=f'{name} ({unit}²/Hz)')
            panel.set_ylim(bottom=0)
            panel.xaxis.set_major_locator(ticks(4))
            panel.yaxis.set_major_locator(ticks(4))
    return drawing.svg


def _edge(frequency: Array, density: Array) -> float:
    """Find a frequency that has 99.5 % of the energy below it, with room to the right."""
    share = np.cumsum(density) / np.sum(density)
    enough = 1.3 * frequency[np.searchsorted(share, 0.995)]
    return float(min(max(enough, 0.25), frequency[-1], 2.0))
