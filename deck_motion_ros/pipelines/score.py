"""The predictor's score on /diagnostics, in words and figures."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from deck_motion_ros.estimators.scoring import Score, useful_horizon
from deck_motion_ros.pipelines.pipeline import OK, Status, WARN

ENOUGH = 60  # forecasts, at two a second: before, a few waves would decide
TOO_FEW = 0.8  # of what came in the 95 % interval: some dozen waves do not come below by chance
TOO_WRONG = 1.1  # times the motion: by chance a little above 1 where nothing can be forecast


def score_status(scores: Sequence[Score], horizon: float, window: float) -> Status:
    """
    Report how good the forecasts have been.

    Parameters
    ----------
    scores : sequence of Score
        By horizon, increasing.
    horizon : float
        The one that decides on level and message (s).
    window : float
        What the scores look back on (s).

    """
    ratios = [score.over(score.motion) for score in scores]
    useful = useful_horizon([score.horizon for score in scores], ratios)
    own = next(score for score in scores if score.horizon == horizon)
    values = {'window': f'{window:g} s',
              'compared_with': 'heights measured later, with the noise of the sensor',
              'motion_sd': _figure(own.motion), 'noise_sd': _figure(own.noise),
              'useful_horizon': _figure(useful)}
    for score in scores:
        values |= {f'{name}_{score.horizon:g}s': figure for name, figure in {
            'forecasts': f'{score.number}', 'rmse': _figure(score.rmse),
            'ratio_to_motion': _figure(score.over(score.motion)),
            'ratio_to_zero': _figure(score.over(score.zero)),
            'ratio_to_persistence': _figure(score.over(score.persistence)),
            'coverage_68': _figure(score.coverage_68),
            'coverage_95': _figure(score.coverage_95)}.items()}
    return 'predictor: score', *_verdict(own, useful, scores), values


def _verdict(own: Score, useful: float, scores: Sequence[Score]) -> tuple[int, str]:
    ahead = f'{own.horizon:g} s ahead'
    if own.number < ENOUGH:
        return OK, f'too early to judge: {own.number} forecasts have come true'
    if own.motion < own.noise:
        return OK, (f'calm: the motion is {own.motion:.2f} m, within the noise of the sensor '
                    f'({own.noise:.2f} m)')
    if own.over(own.motion) > TOO_WRONG:
        return WARN, (f'do not rely on the forecast: {ahead} it was wrong by {own.rmse:.2f} m, '
                      f'more than the motion itself ({own.motion:.2f} m)')
    if own.coverage_95 < TOO_FEW:
        return WARN, (f'allow a wider margin: the 95 % interval stated {ahead} held '
                      f'{100 * own.coverage_95:.0f} % of what came')
    reach = (f'not useful as far as {scores[0].horizon:g} s ahead' if not useful > 0 else
             f'useful {useful:.1f} s ahead' + ' and beyond' * (useful == scores[-1].horizon))
    return OK, (f'{ahead} wrong by {own.rmse:.2f} m rms, the motion is {own.motion:.2f} m; 95 % '
                f'interval held {100 * own.coverage_95:.0f} %; {reach}')


def _figure(value: float) -> str:
    return '' if isnan(value) else f'{value:.4g}'
