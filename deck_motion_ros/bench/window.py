"""Landing windows of the frozen scenarios: skill, reliability, crest times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from deck_motion_ros.bench.figures import Figure
from deck_motion_ros.evaluation.parallel import results
from deck_motion_ros.evaluation.windows import pooled, scenario_scores, SCENARIOS, WindowScores

SHARES = 0.05, 0.95  # a scenario that is quiet always or never says nothing of skill


def window() -> Iterator[Figure | float | str]:
    """Run the scenarios on all cores; give what share is done, and the figures."""
    found: list[list[WindowScores]] = []
    for scores in results(partial(scenario_scores, case) for case in SCENARIOS):
        found.append(scores)
        yield len(found) / len(SCENARIOS)
    yield from figures([item for scores in found for item in scores])


def figures(scores: Sequence[WindowScores]) -> Iterator[Figure]:
    """Sum up scores, each of a scenario under one set of limits."""
    named = partial(Figure, 'window')
    low, high = SHARES
    mixed = [item for item in scores if low < item.share < high]
    everything = pooled(mixed)
    yield named('Brier skill of quiet for 5 s, mean of scenarios',
                float(np.mean([item.skill for item in mixed])), '', goal='>= 0.75')
    yield named('Brier skill of quiet for 5 s, all windows together', everything.skill, '')
    for said, came, number in everything.reliability():
        yield named(f'quiet where {said:.2f} was promised, {number} windows', came, '')
    yield named('quiet after go', 100 * everything.go_right, '%')
    _, error, sd = np.abs(pooled(scores).timings(2.0, 4.0).T)
    yield named('crest and trough timing 2-4 s ahead, median error', float(np.median(error)), 's',
                goal='<= 0.15')
    for probability, width in ((68, 1.0), (95, 1.96)):
        yield named(f'coverage of the {probability} % interval of these times',
                    100 * float(np.mean(error <= width * sd)), '%')
    for item in mixed:
        yield named(f'Brier skill, {item.name}', item.skill, '', headline=False)
        yield named(f'share of quiet windows, {item.name}', 100 * item.share, '%',
                    headline=False)
