"""What the page says of any bag: its topics, gaps and rejects, the nodes' settings."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
import re

from deck_motion_ros.evaluation.contents import Contents
from deck_motion_ros.evaluation.report.drawing import Clock, presence
from deck_motion_ros.evaluation.report.page import figure, note, rate, section, table

MOST_GAPS = 12  # listed


def recorded(contents: Contents, texts: Sequence[str]) -> str:
    """List the topics, below what each chapter says of them."""
    rows = []
    for name, (kind, found) in contents.topics.items():
        longest = max((length for _, length in found.gaps), default=0.0)
        rows.append((name, kind, f'{found.count}', rate(found.rate),
                     f'{longest:.1f} s' if longest else '–'))
    return section(
        'What was recorded',
        *(f'<p>{escape(text)}</p>' for text in texts),
        table(('topic', 'type', 'messages', 'rate', 'longest gap'), rows, texts=2),
        note('Rates and gaps are those of the time stamps in the messages; a gap is 2.5 times '
             'as long as nine of ten steps are at most, and does not count in the rate.'))


def gaps(contents: Contents, clock: Clock) -> str:
    """Show when topics were silent and what was rejected, by the nodes or here."""
    shown = {name: found for name, (_, found) in contents.topics.items()
             if found.count and name != '/diagnostics'}
    found = sorted(((length, stamp, name) for name, each in shown.items()
                    for stamp, length in each.gaps), reverse=True)
    parts = [] if found else ['<p>No topic had a gap.</p>']
    if found:
        parts.append(figure(
            presence(shown, clock), 'Blue: messages came; orange: a gap.' +
            ' The stamps of touchdown/height and touchdown/prediction lie ahead by the horizon.'
            * ('touchdown/height' in contents.held)))
        parts.append(table(
            ('topic', f'after ({clock.unit})', 'gap'),
            [(name, f'{clock(stamp):.2f}', f'{length:.2f} s')
             for length, stamp, name in found[:MOST_GAPS]]))
        if len(found) > MOST_GAPS:
            parts.append(note(f'The longest {MOST_GAPS} of {len(found)} gaps.'))
    troubles = [(name, what, f'{count}') for name, found in shown.items() for what, count in (
        ('the same stamp again', found.duplicates), ('a stamp older than one before',
                                                     found.backwards)) if count]
    troubles += [(topic, f'not usable for this report: {reason}', f'{count}')
                 for (topic, reason), count in contents.unusable.items()]
    for name, (_, _, values) in contents.states.items():
        troubles += [(name, key, value) for key, value in values.items()
                     if value != '0' and re.match('rejected|restarts|.*unexpected', key)]
    troubles += [(name, 'warnings or errors on /diagnostics', f'{count}')
                 for name, count in contents.warned.items() if count]
    if troubles:
        parts.append(table(('where', 'what', 'how often'), troubles, texts=2))
    else:
        parts.append('<p>No message was rejected, repeated or out of order.</p>')
    reports = [(name, message) for name, (_, message, _) in contents.states.items()]
    if reports:
        parts.append(table(('reported by', 'last state'), reports, texts=2))
    return section('Gaps and rejects', *parts)


def settings(contents: Contents) -> str:
    """List what each node said of its parameters."""
    return section('Settings', *(
        table((node, ''), [(name, 'unset' if value == 'nan' else value)
                           for name, value in sorted(values.items())], texts=2)
        for node, values in sorted(contents.settings.items()))) if contents.settings else ''
