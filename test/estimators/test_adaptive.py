"""The learning predictor: its parts by hand-solvable cases, the whole by ideal and by bad data."""

import numpy as np
import pytest

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.combining import Combination
from deck_motion_ros.estimators.joint import readout
from deck_motion_ros.estimators.resampling import Grid, Resampler
from deck_motion_ros.estimators.shaping import ShapingPredictor
from deck_motion_ros.estimators.var import ForgettingVar, VarModel
from deck_motion_ros.samples import AXES, HEAVE, PITCH, ROLL

VARS = (1e-6, 1e-6, 1e-4)


def test_var_recovers_a_known_var():
    mat = np.array([[0.5, 0.3, -0.4, 0.0], [-0.2, 0.9, 0.1, -0.5]])
    rng = np.random.default_rng(1)
    y = np.zeros((20000, 2))
    for t in range(2, len(y)):
        y[t] = mat @ np.concatenate([y[t - 1], y[t - 2]]) + rng.standard_normal(2) * (1.0, 3.0)
    y += (5.0, -2.0)
    var = ForgettingVar(2, 2, memory=np.inf)
    var.learn(y[:10000])
    var.learn(y[9998:])
    model = var.solve(y.mean(axis=0), np.zeros(2))
    scale = np.array([1.0, 3.0])[:, None] / np.array([1.0, 3.0, 1.0, 3.0])
    assert np.abs((model.coefficients - mat) / scale).max() < 0.03  # 4 sd of the estimate


def test_old_samples_are_forgotten():
    rng = np.random.default_rng(2)
    y = np.zeros((4000, 1))
    for t in range(1, len(y)):
        y[t] = (0.9 if t < 2000 else -0.9) * y[t - 1] + rng.standard_normal()
    var = ForgettingVar(1, 1, memory=200)
    var.learn(y)
    assert var.solve(np.zeros(1), np.zeros(1)).coefficients[0, 0] == pytest.approx(-0.9, abs=0.1)


def test_what_has_faded_gives_way_to_what_is_new():
    rng = np.random.default_rng(6)
    first, then = rng.standard_normal((2, 500, 1))
    var, fresh = (ForgettingVar(1, 2, memory=np.inf) for _ in range(2))
    var.learn(np.cumsum(first, axis=0))
    half = var.learned(np.zeros(1)) / 2
    var.fade(0.5)
    np.testing.assert_allclose(var.learned(np.zeros(1)), half)
    var.fade(1e-12)
    var.learn(then)
    fresh.learn(then)
    found, alone = (each.solve(np.zeros(1), np.zeros(1)).coefficients for each in (var, fresh))
    np.testing.assert_allclose(found, alone, atol=1e-6)


def test_samples_that_were_not_measured_teach_nothing():
    rng = np.random.default_rng(3)
    y = np.cumsum(rng.standard_normal((300, 1)), axis=0)
    false = y.copy()
    false[100] += 1000.0
    known = np.ones(300, bool)
    known[[100, 101]] = False  # neither it nor the one predicted from it
    learned = []
    for record in (y, false):
        var = ForgettingVar(1, 1, memory=np.inf)
        var.learn(np.vstack([y[:1], record]), known)
        learned.append(var.moments)
    np.testing.assert_allclose(learned[0], learned[1])


def test_iterating_equals_stepping_by_hand():
    rng = np.random.default_rng(4)
    model = VarModel(0.2 * rng.standard_normal((3, 12)), np.array([1.0, -2.0, 0.5]))
    past = rng.standard_normal((4, 3))
    forecast, offset = model.ahead(6)
    series = list(past[::-1])
    for k in range(6):
        newest_first = np.concatenate([series[-1 - j] - model.mean for j in range(4)])
        series.append(model.mean + model.coefficients @ newest_first)
        np.testing.assert_allclose(forecast[k] @ past.ravel() + offset[k], series[-1], atol=1e-12)


@pytest.mark.parametrize('grid', [Grid.of_period(0.1), Grid.of_period(0.01), Grid.of_period(1.0)])
def test_readout_undoes_the_slots(grid):
    omega, times = 0.9, np.arange(9) * 0.5
    value = readout(grid, times, 5, 12)
    middles = np.arange(-4, 13) * grid.step - grid.age
    gain = (np.sinc(omega * grid.step / 2 / np.pi) * np.sinc(omega * grid.tick / 2 / np.pi)**2
            if grid.ticks > 1 else 1.0)
    slots = gain * np.cos(omega * middles)
    np.testing.assert_allclose(value @ slots, np.cos(omega * times), atol=0.01)


def test_weights_are_those_of_independent_errors():
    rng = np.random.default_rng(5)
    combination = Combination(1, 1, 3, half_life=1e9)
    for errors in rng.standard_normal((20000, 1, 3, 1)) * np.array([1.0, 2.0, 50.0])[:, None]:
        combination.score(errors, np.ones((1, 3), bool))
    everybody = np.ones(3, bool)
    combination.RIDGE = 0.0
    np.testing.assert_allclose(combination.weights(everybody, np.zeros(1)), [[[0.8, 0.2, 0.0]]],
                               atol=0.01)
    silent = np.array([False, True, True])
    assert combination.weights(silent, np.zeros(1))[0, 0, 0] == 0


def test_axes_share_what_they_say_of_the_rivals():
    combination = Combination(1, 2, 2, half_life=1e9)
    rng = np.random.default_rng(7)
    size = np.array([[1.0, 3.0], [2.0, 1.0]])  # rival, axis
    for errors in rng.standard_normal((20000, 1, 2, 2)) * size:
        combination.score(errors, np.ones((1, 2), bool))
    combination.RIDGE = 0.0
    both = np.ones(2, bool)

    def weights(pooled):
        combination.POOLED = pooled
        return combination.weights(both, np.zeros(2))[0]

    np.testing.assert_allclose(weights(0.0), [[0.8, 0.2], [0.1, 0.9]], atol=0.01)
    own, pooled = np.array([[1, 4], [9, 1]]), np.array([5, 2.5])  # over the best one's
    for share in (0.4, 1.0):
        var = own + share * (pooled - own)
        np.testing.assert_allclose(weights(share), var[:, ::-1] / var.sum(axis=1)[:, None],
                                   atol=0.01)


def test_after_fading_few_errors_turn_the_weights():
    combination = Combination(1, 1, 2, half_life=1e9)
    both, before = np.ones((1, 2), bool), np.array([[[1.0], [3.0]]])
    for k in range(1000):
        combination.score(before * (-1)**k, both)
    combination.fade(1e-6, least=20.0)
    assert combination.scored == 20
    np.testing.assert_allclose(combination.covariance[0, 0], [[1, 3], [3, 9]])
    combination.fade(1e-6, least=20.0)
    assert combination.scored == 20
    for k in range(20):
        combination.score(before[:, ::-1] * (-1)**k, both)
    np.testing.assert_allclose(np.diag(combination.covariance[0, 0]), 5)


def test_a_newcomer_is_taken_for_a_little_worse_than_the_best():
    combination = Combination(1, 1, 3, half_life=100)
    for k in range(200):
        error = np.array([[[1.0 if k % 2 else -1.0], [3.0], [0.0]]])
        combination.score(error, np.array([[True, True, False]]))
    combination.introduce(2, np.array([True, True, True]))
    cov = combination.covariance[0, 0]
    assert cov[2, 2] == Combination.NEWCOMER * cov[0, 0] and cov[2, 1] == cov[0, 1]


def test_a_ramp_survives_uneven_stamps():
    rng = np.random.default_rng(6)
    times = np.cumsum(rng.uniform(0.06, 0.14, 500))
    resampler = Resampler(Grid.of_period(0.1), 1, times[0])
    ticks = [tick for time in times for tick in resampler.add(0, float(time), 2.0 * float(time))]
    ends = np.array([times[0], *(tick.time for tick in ticks)])
    middles = (ends[1:] + ends[:-1]) / 2
    np.testing.assert_allclose([tick.values[0] for tick in ticks], 2.0 * middles, rtol=1e-9)
    assert abs(ends[-1] - times[-1]) < 0.3 and all(all(tick.known) for tick in ticks)


@pytest.mark.parametrize('rate', [1.0, 2.0, 4.0, 10.0, 100.0])
def test_the_grid_is_locked_to_even_stamps(rate):
    resampler = Resampler(Grid.of_period(1 / rate), 2, 0.0)
    lag = []
    for k in range(1, int(20 * rate)):
        made = [tick for axis in (0, 1) for tick in resampler.add(axis, k / rate, 1.0)]
        lag += [k / rate - tick.time for tick in made]
    assert len(lag) > 15 and max(map(abs, lag)) < 1e-6


class Ship:
    """Coupled ideal motion: narrow-band lines with random phases, and a little noise."""

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        self.omega = np.sort(rng.uniform(0.3, 1.0, 400))
        spectrum = np.exp(-((self.omega - 0.6) / 0.12)**2 / 2)
        phase = rng.uniform(0, 2 * np.pi, 400)
        amplitude = np.sqrt(2 * spectrum / spectrum.sum())
        lag = np.stack([2.0 * self.omega, 1.2 + 0.5 * self.omega, 0 * self.omega])
        size = np.stack([0.05 / (1 + (8 * (self.omega - 0.55))**2), 0.02 * self.omega,
                         np.ones(400)])
        self.response = size * amplitude * np.exp(1j * (phase + lag))

    def at(self, times):
        wave = np.exp(1j * np.outer(times, self.omega))
        return np.real(wave @ self.response.T)

    def rate_at(self, times):
        wave = 1j * self.omega * np.exp(1j * np.outer(times, self.omega))
        return np.real(wave @ self.response.T)


def measured(ship, times, seed=0, size=1.0):
    noise = np.random.default_rng(seed).standard_normal((len(times), 3))
    return ship.at(times) + size * noise * np.sqrt(VARS)


def feed(predictor, times, values, axes=(ROLL, PITCH, HEAVE)):
    for time, row in zip(times.tolist(), values.tolist()):
        for axis in axes:
            if np.isfinite(row[axis]):
                predictor.measure(axis, time, row[axis], VARS[axis])
    return predictor


def errors_along(predictor, ship, times, values, after, horizon=3.0, every=8,
                 axes=(ROLL, PITCH, HEAVE)):
    """Feed and return errors and sds (n, 3) of the forecasts made after a time."""
    errors, sds = [], []
    for k, (time, row) in enumerate(zip(times.tolist(), values)):
        feed(predictor, np.array([time]), row[None], axes)
        if time >= after and k % every == 0:
            ahead = predictor.outlook().forecast(time, np.array([horizon]))
            errors.append(ahead.mean[0] - ship.at(np.array([time + horizon]))[0])
            sds.append(np.sqrt(np.diag(ahead.cov[0])))
    return np.array(errors), np.array(sds)


@pytest.fixture(scope='module')
def four_hertz():
    ship, times = Ship(), np.arange(0, 420, 0.25)
    values = measured(ship, times)
    return ship, times, values, errors_along(AdaptivePredictor(), ship, times, values, 180)


def test_learns_what_no_fixed_filter_knows(four_hertz):
    ship, times, values, (errors, _) = four_hertz
    filters, _ = errors_along(ShapingPredictor(), ship, times[:1200], values[:1200], 180)
    motion = ship.at(times).std(axis=0)
    assert np.all(errors.std(axis=0) < 0.35 * filters.std(axis=0))
    assert np.all(errors.std(axis=0) < 0.2 * motion)


def test_covers_what_it_promises(four_hertz):
    _, _, _, (errors, sds) = four_hertz
    inside = np.mean(np.abs(errors) < 1.96 * sds)
    assert 0.90 < inside < 0.995


def test_the_rate_is_the_derivative(four_hertz):
    ship, times, values, _ = four_hertz
    predictor = feed(AdaptivePredictor(), times[:1000], values[:1000])
    now, horizons = float(times[999]), np.array([0.7, 2.0, 3.3, 5.0])
    step = 1e-3
    outlook = predictor.outlook()
    ahead = outlook.forecast(now, horizons)
    around = [outlook.forecast(now, horizons + shift).mean for shift in (-step, step)]
    slopes = (around[1] - around[0]) / (2 * step)
    usual = np.gradient(ship.at(times), 0.25, axis=0).std(axis=0)
    assert np.all(np.abs(ahead.rate - slopes) < 0.06 * usual)
    assert np.all(np.linalg.eigvalsh(ahead.cov) > 0)
    assert np.all(np.linalg.eigvalsh(ahead.rate_cov) > 0)
    np.testing.assert_allclose(outlook.mean(now + 2.0), ahead.mean[1], rtol=1e-12)


def test_the_far_future_is_the_mean_and_as_uncertain_as_the_motion(four_hertz):
    ship, times, values, _ = four_hertz
    offset = np.array((0.03, -0.01, 0.4))
    outlook = feed(AdaptivePredictor(), times, values + offset).outlook()
    now, motion = float(times[-1]), ship.at(times).std(axis=0)
    far = outlook.forecast(now, np.array([60.0, 300.0]))
    assert np.all(np.abs(far.mean - offset) < 0.1 * motion)
    assert np.all(np.abs(far.rate) < 0.01 * motion)
    np.testing.assert_allclose(np.sqrt(np.einsum('nii->ni', far.cov)), [motion, motion], rtol=0.3)
    late = np.arange(10.0, 30.0, 0.01)  # s ahead: over the last horizon and the last knot
    ahead = outlook.forecast(now, late)
    assert np.all(np.abs(np.diff(ahead.mean, axis=0)) < 0.02 * motion)
    rate = np.gradient(ahead.mean, 0.01, axis=0)
    assert np.all(np.abs(ahead.rate - rate)[late > 12.5] < 0.01 * motion)
    np.testing.assert_allclose(outlook.mean(now + 20.0), outlook.forecast(
        now, np.array([20.0])).mean[0], rtol=1e-12)


def test_the_rate_is_as_sure_as_it_says_and_no_worse_than_the_slope_of_the_value():
    ship, times = Ship(7), np.arange(0, 540, 0.25)
    predictor, values = AdaptivePredictor(), measured(ship, times)
    horizons, rates, slopes, sds = np.array([1.0, 3.0, 8.0]), [], [], []
    for k, (time, row) in enumerate(zip(times.tolist(), values)):
        feed(predictor, np.array([time]), row[None])
        if time >= 180 and k % 3 == 0:
            outlook, came = predictor.outlook(), ship.rate_at(time + horizons)
            ahead = outlook.forecast(time, horizons)
            early, late = (outlook.forecast(time, horizons + shift) for shift in (-0.1, 0.1))
            rates.append(ahead.rate - came)
            slopes.append((late.mean - early.mean) / 0.2 - came)
            sds.append(np.sqrt(np.einsum('nii->ni', ahead.rate_cov)))
    rates, slopes, sds = map(np.array, (rates, slopes, sds))
    inside = np.mean(np.abs(rates) < 1.96 * sds, axis=(0, 2))
    assert np.all((inside > 0.88) & (inside < 0.99))
    assert np.all(rates.std(axis=0) < 1.02 * slopes.std(axis=0))


def test_an_outlook_is_frozen(four_hertz):
    _, times, values, _ = four_hertz
    predictor = feed(AdaptivePredictor(), times[:500], values[:500])
    outlook, now = predictor.outlook(), float(times[499])
    before = outlook.forecast(now, np.array([1.0, 3.0]))
    feed(predictor, times[500:600], values[500:600])
    after = outlook.forecast(now, np.array([1.0, 3.0]))
    assert all(np.array_equal(getattr(before, name), getattr(after, name))
               for name in ('mean', 'cov', 'rate', 'rate_cov'))


def test_order_within_a_stamp_changes_nothing(four_hertz):
    _, times, values, _ = four_hertz
    rng = np.random.default_rng(7)
    made = []
    for shuffled in (False, True):
        predictor = AdaptivePredictor()
        for time, row in zip(times[:600].tolist(), values[:600].tolist()):
            for item in rng.permutation(4).tolist() if shuffled else range(4):
                if item == len(AXES):
                    predictor.head(time, 0.3 * np.sin(time / 5))
                else:
                    predictor.measure(item, time, row[item], VARS[item])
        made.append(predictor.outlook().forecast(float(times[599]), np.arange(1, 21) * 0.5))
    assert np.array_equal(made[0].mean, made[1].mean)
    assert np.array_equal(made[0].cov, made[1].cov)


@pytest.mark.parametrize('axes', [(HEAVE,), (ROLL, PITCH)])
def test_learns_from_the_axes_that_come(axes):
    ship, times = Ship(1), np.arange(0, 300, 0.25)
    errors, _ = errors_along(AdaptivePredictor(), ship, times, measured(ship, times), 180,
                             axes=axes)
    there = list(axes)
    assert np.all(errors.std(axis=0)[there] < 0.4 * ship.at(times).std(axis=0)[there])


@pytest.mark.parametrize('period', [1.0, 0.78])
def test_learns_from_slow_uneven_input(period):
    ship, rng = Ship(2), np.random.default_rng(8)
    times = np.arange(0, 600, period)
    times = times + rng.uniform(-0.03, 0.03, len(times))
    errors, _ = errors_along(AdaptivePredictor(), ship, times, measured(ship, times), 300, every=1)
    assert np.all(errors.std(axis=0) < 0.35 * ship.at(times).std(axis=0))


def test_axes_with_stamps_and_rates_of_their_own():
    ship, predictor = Ship(3), AdaptivePredictor()
    calls = sorted([(k * 0.1 + 0.03, axis) for k in range(2400) for axis in (ROLL, PITCH)]
                   + [(k * 0.25, HEAVE) for k in range(960)])
    times = np.array([time for time, _ in calls])
    truth, errors = ship.at(times), []
    for k, (time, axis) in enumerate(calls):
        predictor.measure(axis, time, float(truth[k, axis]), VARS[axis])
        if time > 180 and axis == HEAVE:
            errors.append(predictor.outlook().mean(time + 3.0) - ship.at(np.array([time + 3]))[0])
    assert np.all(np.std(errors, axis=0) < 0.3 * truth.std(axis=0))


def test_a_profile_warms_the_start(four_hertz):
    """In six seas of the taught spectrum, over the first two minutes and over the second."""
    ship, times, values, _ = four_hertz
    profile = feed(AdaptivePredictor(), times[:1400], values[:1400]).profile()
    offset, other = np.array((0.03, -0.01, 0.4)), Ship(5)
    errors = {'cold': [], 'warm': []}
    for seed in range(6, 12):
        phase = np.random.default_rng(seed).uniform(0, 6.28, 400)
        other.response = ship.response * np.exp(1j * phase)
        again = measured(other, times[:480], 1) + offset
        for name, given in (('cold', None), ('warm', profile)):
            found, _ = errors_along(AdaptivePredictor(given), other, times[:480], again, 30.0)
            errors[name].append(found - offset)
    for start in (0, 20):  # seconds 30 and 70
        cold, warm = (np.sqrt(np.mean(np.square(np.array(errors[name])[:, start:]), axis=(0, 1)))
                      for name in ('cold', 'warm'))
        assert np.all(warm < 0.8 * cold)


def test_a_foreign_profile_is_left_aside(four_hertz):
    ship, times, values, _ = four_hertz
    cold, foreign = (errors_along(AdaptivePredictor(given), ship, times[:240], values[:240], 30.0)
                     for given in (None, {'grid': np.ones(5)}))
    np.testing.assert_array_equal(foreign, cold)


def test_a_profile_without_errors_warms_less_but_does_no_harm(four_hertz):
    ship, times, values, _ = four_hertz
    profile = feed(AdaptivePredictor(), times[:1400], values[:1400]).profile()
    later = slice(1400, 1600)
    early = {}
    for name, given in (('cold', None), ('warm', profile), (
            'older', {key: array for key, array in profile.items() if key != 'errors'})):
        found, _ = errors_along(AdaptivePredictor(given), ship, times[later], values[later], 362.0)
        early[name] = np.sqrt(np.mean(np.square(found), axis=0))
    assert np.all(early['warm'] < 0.75 * early['cold'])
    assert np.all(early['older'] < early['cold'])


def test_weights_of_contradicting_pairs_are_still_weights():
    cov = np.array([[1.0, -1.5, -1.0], [-1.5, 2.0, 0.0], [-1.0, 0.0, 7.0]])  # no one's covariance
    combination = Combination(1, 1, 3, half_life=100)
    combination.recall(cov[None, None], 20.0)
    weights = combination.weights(np.ones(3, bool), np.zeros(1))[0, 0]
    assert weights.min() >= 0 and weights.sum() == pytest.approx(1)


def bad(kind, times, values):
    """Spoil a record from second 200 on."""
    values, rng = values.copy(), np.random.default_rng(9)
    late = times >= 200
    sd = values.std(axis=0)
    if kind == 'outliers':
        hit = rng.random(values.shape) < 0.01
        values[hit] += (10 * sd * rng.choice([-1, 1], values.shape))[hit]
    elif kind == 'sign flip':
        values[late, PITCH] *= -1
    elif kind == 'stuck':
        values[late, HEAVE] = values[late, HEAVE][0]
    elif kind == 'dead axis':
        values[late, ROLL] = np.nan
    elif kind == 'swap':
        values[late] += 3 * sd
    elif kind == 'gap':
        values[late & (times < 320)] = np.nan
    elif kind == 'constant':
        values[:] = (0.01, -0.02, 0.5)
    elif kind == 'zero':
        values[:] = 0.0
    return values


@pytest.mark.parametrize('kind', ['outliers', 'sign flip', 'stuck', 'dead axis', 'swap', 'gap',
                                  'constant', 'zero'])
def test_bad_input_does_no_lasting_harm(kind):
    ship, times = Ship(4), np.arange(0, 480, 0.25)
    values = bad(kind, times, measured(ship, times))
    predictor, errors = AdaptivePredictor(), []
    for k, (time, row) in enumerate(zip(times.tolist(), values)):
        feed(predictor, np.array([time]), row[None])
        if k % 10 == 0 and np.isfinite(row).any():
            ahead = predictor.outlook().forecast(time, np.array([0.1, 3.0, 10.0, 12.0]))
            for part in (ahead.mean, ahead.cov, ahead.rate, ahead.rate_cov):
                assert np.isfinite(part).all()
            assert np.linalg.eigvalsh(ahead.cov).min() > 0
            j = k + 12
            if j < len(times):
                errors.append((time, *(ahead.mean[1] - values[j]),
                               *np.sqrt(np.diag(ahead.cov[1]))))
    table = np.array(errors)
    late = table[table[:, 0] > (440 if kind == 'gap' else 360)]
    sd = np.nanstd(values, axis=0) + 0.02 * np.array([0.05, 0.02, 1.0])
    alive = np.isfinite(late[-1, 1:4])
    rms = np.sqrt(np.nanmedian(np.square(late[:, 1:4][:, alive]), axis=0)) * 1.48
    assert np.all(rms < 0.5 * sd[alive])
    if kind in ('sign flip', 'swap'):  # it says so at once
        quiet = table[(table[:, 0] > 180) & (table[:, 0] < 195), 4:].mean(axis=0)
        after = table[(table[:, 0] > 203) & (table[:, 0] < 210), 4:].mean(axis=0)
        assert np.any(after > 2 * quiet)
