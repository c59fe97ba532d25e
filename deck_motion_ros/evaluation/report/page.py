"""The page: its skeleton, its small parts, and numbers as people write them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from html import escape
from math import isfinite
import re

from deck_motion_ros import __version__
from deck_motion_ros.samples import NANOSECONDS, nanoseconds, seconds

Tile = tuple[str, str, str]  # id on the page, number, what it is

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} · deck motion report</title>
<style>{style}</style>
</head>
<body>
<header>
<p class="eyebrow">Deck motion report</p>
<h1>{title}</h1>
<p class="when">{when}</p>
<div class="headline"><p class="first">{first}</p><p>{lead}</p></div>
{tiles}
</header>
<main>
{sections}
</main>
<footer>deck_motion_ros {version}. Roll positive port side up, pitch positive bow down, heave and
height positive up; heights are above where the point rests with roll = pitch = heave = 0.</footer>
</body>
</html>
"""

STYLE = """
:root { --ink: #24292f; --quiet: #59636e; --line: #e1e4e8; --wash: #f5f7f9; --blue: #0072b2; }
* { box-sizing: border-box; }
html { background: #fff; }
body { max-width: 62rem; margin: 0 auto; padding: 3rem 2rem 2rem; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
h1 { margin: 0; font-size: 1.9rem; line-height: 1.2; font-weight: 650; overflow-wrap: anywhere; }
h2 { margin: 3rem 0 .6rem; padding-top: 1.4rem; border-top: 1px solid var(--line);
  font-size: 1.25rem; font-weight: 650; }
p { margin: .5rem 0; max-width: 46rem; }
.eyebrow { margin: 0 0 .3rem; color: var(--blue); font-size: .8rem; font-weight: 650;
  letter-spacing: .08em; text-transform: uppercase; }
.when, figcaption, .note, footer { color: var(--quiet); }
.when { margin: .3rem 0 1.4rem; }
.headline { padding: 1.1rem 1.4rem; border-left: 4px solid var(--blue); background: var(--wash); }
.headline .first { font-size: 1.25rem; line-height: 1.4; font-weight: 600; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: 1rem;
  margin: 1.2rem 0 0; }
.tile { padding: .8rem 1rem; border: 1px solid var(--line); border-radius: 6px; }
.tile b { display: block; font-size: 1.6rem; line-height: 1.25; font-weight: 650; }
.tile.main b { color: var(--blue); }
.tile span { color: var(--quiet); font-size: .88rem; line-height: 1.3; display: block; }
figure { margin: 1rem 0 1.6rem; overflow-x: auto; }
figure svg { display: block; width: 100%; height: auto; }
figcaption, .note { margin-top: .5rem; max-width: 46rem; font-size: .92rem; }
table { margin: 1rem 0 1.4rem; border-collapse: collapse; font-size: .92rem;
  font-variant-numeric: tabular-nums; }
th, td { padding: .3rem 1.1rem .3rem 0; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: baseline; white-space: nowrap; }
th { color: var(--quiet); font-weight: 500; border-bottom-color: #c4cad0; }
td.text, th.text { text-align: left; white-space: normal; overflow-wrap: break-word;
  max-width: 34rem; }
tr.strong td { font-weight: 650; }
.scroll { overflow-x: auto; }
footer { margin-top: 3rem; padding-top: 1rem; border-top: 1px solid var(--line);
  font-size: .85rem; }
@media (max-width: 44rem) { body { padding: 1.5rem 1rem; } figure svg { min-width: 40rem; } }
@media print {
  @page { margin: 15mm 14mm; }
  html { font-size: 10.5px; }
  body { padding: 0; max-width: none; font-size: 10.5px; }
  h2 { margin-top: 1.8rem; padding-top: 1rem; break-after: avoid; }
  figure, table, .tiles, .headline { break-inside: avoid; }
  .scroll { overflow: visible; }
  * { print-color-adjust: exact; }
}
"""


def page(title: str, when: str, headline: Sequence[str], tiles: Iterable[str],
         sections: Iterable[str]) -> str:
    """
    Compose the page.

    Parameters
    ----------
    title, when : str
        Plain text.
    headline : sequence of str
        Plain sentences, the first of them large.
    tiles, sections : iterable of str
        Made by :func:`tiles_row` and :func:`section`; empty ones are left out.

    """
    first, *others = map(escape, headline)
    return PAGE.format(title=escape(title), when=escape(when), style=STYLE, first=first,
                       lead=' '.join(others), tiles='\n'.join(filter(None, tiles)),
                       sections='\n'.join(filter(None, sections)), version=__version__)


def section(heading: str, *parts: str) -> str:
    """Put parts under a heading, which is text."""
    return f'<section>\n<h2>{escape(heading)}</h2>\n' + '\n'.join(parts) + '\n</section>'


def figure(svg: str, caption: str) -> str:
    """Put a drawing above its caption, which is text."""
    return f'<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>'


def note(text: str) -> str:
    """Set a note in small print."""
    return f'<p class="note">{escape(text)}</p>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]], strong: int = -1,
          texts: int = 1) -> str:
    """Set a table whose first ``texts`` columns are text, one row of it strong."""
    def cells(tag: str, row: Sequence[str]) -> str:
        return ''.join(f'<{tag}{TEXT * (column < texts)}>{typeset(cell)}</{tag}>'
                       for column, cell in enumerate(row))
    body = ''.join(f"<tr{' class=strong' * (number == strong)}>{cells('td', row)}</tr>\n"
                   for number, row in enumerate(rows))
    return (f'<div class="scroll"><table><thead><tr>{cells("th", head)}</tr></thead>\n'
            f'<tbody>{body}</tbody></table></div>')


TEXT = ' class="text"'


def typeset(text: str) -> str:
    """Escape a cell, with a true minus where a number begins."""
    return escape(re.sub(r'^-(?=\d)', '\N{MINUS SIGN}', text))


def tiles_row(tiles: Sequence[Tile]) -> str:
    """Set tiles, the first of them in colour."""
    return ''.join((
        '<div class="tiles">',
        *(f'<div class="tile{" main" * (not number)}"><b id="{key}">{value}</b>'
          f'<span>{label}</span></div>' for number, (key, value, label) in enumerate(tiles)),
        '</div>')) if tiles else ''


def metres(value: float) -> str:
    """
    Write a length as people say it.

    >>> metres(2.2466), metres(0.0312)
    ('2.25 m', '3.1 cm')
    """
    if not isfinite(value):
        return '–'
    return fixed(value, 2, ' m') if abs(value) >= 0.0995 else fixed(100 * value, 1, ' cm')


def fixed(value: float, digits: int, unit: str) -> str:
    """Write a number with so many digits; what rounds to 0 has no sign."""
    return f'{round(value, digits) + 0.0:.{digits}f}{unit}'


def percent(value: float) -> str:
    """Write a share; a dash for NaN."""
    return f'{100 * value:.1f} %' if isfinite(value) else '–'


def period(value: float) -> str:
    """Write a period (s); a dash for NaN."""
    return f'{value:.1f} s' if isfinite(value) else '–'


def ratio(value: float) -> str:
    """Write a ratio; a dash for NaN."""
    return f'{value:.2f}' if isfinite(value) else '–'


def rate(value: float) -> str:
    """Write a rate (Hz); a dash for NaN."""
    return f'{value:.3g} Hz' if isfinite(value) else '–'


def duration(length: int) -> str:
    """
    Write a duration (ns).

    >>> duration(624_000_000_000)
    '10 min 24 s'
    """
    total = seconds(length)
    if total < 60:
        return f'{total:.1f} s'
    hours, rest = divmod(round(total), 3600)
    minutes, remainder = divmod(rest, 60)
    return (f'{hours} h ' if hours else '') + f'{minutes} min {remainder} s'


def moment(stamp: int) -> str:
    """Write a stamp as date and time; small ones count from the recorder's own zero."""
    if stamp < nanoseconds(365 * 86400.0):
        return f'start at {seconds(stamp):.2f} s of its own clock'
    return f'{datetime.fromtimestamp(stamp // NANOSECONDS, timezone.utc):%Y-%m-%d %H:%M:%S} UTC'
