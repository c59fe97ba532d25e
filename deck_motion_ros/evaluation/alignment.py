"""Bai2016's experiment: transfer alignment on the catapult, disturbed, down to the bound."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import degrees, pi, radians
from typing import Any

import numpy as np

from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.alignment import AlignmentConfig, transfer_model
from deck_motion_ros.estimators.fading import StrongTracking
from deck_motion_ros.estimators.transfer import (
    ACROSS,
    ALL,
    reference_velocity,
    TransferFilter,
    TransferModel,
    VEL,
)
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.geometry import rotation_matrix, rotation_vectors
from deck_motion_ros.samples import Array
from deck_motion_ros.scenarios import Bai2016Scenario
from deck_motion_ros.simulation.catapult import ARCMIN, CatapultSensors, CatapultSimulatorConfig

FORGOTTEN = 10.0  # m/s
AXES = {'pitch': 1, 'roll': 0, 'heading': 2}  # about left, forward, up
LOST = {  # along the shaking of the experiment; in the plane of shaking and thrust
    'line': ((1.0, 0.0, 1.0),), 'plane': ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))}
OTHERS: dict[str, dict[str, Any]] = {  # than the launches of the experiment
    'along': {'vibration_direction': (1.0, 0.0, 0.0)},
    'upward': {'vibration_direction': (0.0, 0.0, 1.0)},
    'aside': {'vibration_direction': (0.3, 1.0, -0.5)},
    'oblique': {'vibration_direction': (1.0, 0.02, 1.0)},
    'turning': {'vibration_lag_deg': (0.0, 0.0, 90.0)},
    'ramp': {'ramp': 0.5, 'skew': 0.005}, 'early': {'skew': -0.01},
    'sea': {'deck': 'sea', 'hull': 'patrol'}}
UNOBSERVABLE = np.array([2.0, 0.0, 1.0]) / np.sqrt(5)  # along the force of a stroke of 2 g
PRINTED = {  # Table 1, absolute
    'kalman': {'pitch': (1.83, 3.63, 7.25), 'roll': (0.46, 0.45, 0.45),
               'heading': (1.71, 1.78, 1.92)},
    'strong_tracking': {'pitch': (0.32, 0.85, 1.92), 'roll': (0.44, 0.42, 0.39),
                        'heading': (1.62, 1.61, 1.59)}}


@dataclass(frozen=True)
class Case:
    """
    One Monte Carlo: what is simulated, what filters it, what the filter is told.

    Attributes
    ----------
    simulated : CatapultSimulatorConfig
        The launch.
    model : TransferModel
        The filter.
    random : bool
        Random misalignment, frequency and phase; else the paper's and the configuration's.
    first_sd_arcmin : tuple of 3 float
        What the filter believes of the misalignment.
    velocity_sd : float or None
        And of the first velocity (m/s); None: what the reference is worth.
    silent : tuple of 2 float
        The velocimeter drops out from, to, after the launch (s).
    arm_sd : float
        Error of the lever arm that the filter is told (m).
    lost : tuple of tuple of 3 float
        Directions (track axes) in which the filter forgets the velocity, once, at the launch.

    """

    simulated: CatapultSimulatorConfig
    model: TransferModel
    random: bool = True
    first_sd_arcmin: tuple[float, ...] = (15.0, 10.0, 30.0)
    velocity_sd: float | None = None
    silent: tuple[float, float] = (0.0, 0.0)
    arm_sd: float = 0.0
    lost: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Outcome:
    """
    What a Monte Carlo ends with.

    Attributes
    ----------
    error : ndarray, shape (runs, 3)
        Of the attitude about forward, left, up (arcmin).
    cov : ndarray, shape (runs, 3, 3)
        What the filter believes of it (arcmin^2).

    """

    error: Array
    cov: Array

    @property
    def absolute(self) -> Array:
        """Absolute errors, shape (runs, 3)."""
        return np.abs(self.error)

    @property
    def rms(self) -> Array:
        """Root mean square errors, shape (3,)."""
        return np.asarray(np.sqrt(np.mean(np.square(self.error), axis=0)))

    @property
    def sd(self) -> Array:
        """What the filter says they are, shape (3,)."""
        return np.asarray(np.sqrt(np.mean(np.diagonal(self.cov, axis1=1, axis2=2), axis=0)))

    @property
    def nees(self) -> float:
        """Mean normalised squared error of the three angles: 1 if the filter is honest."""
        solved = np.linalg.solve(self.cov, self.error[..., None])[..., 0]
        return float(np.mean(np.sum(self.error * solved, axis=1)) / 3)


def monte_carlo(case: Case, runs: int, seed: int, scenario: Bai2016Scenario) -> Outcome:
    """
    Run the filter of the live node over many launches at once.

    Parameters
    ----------
    case : Case
        What is run.
    runs, seed : int
        Number of launches, and of their generator: cases of one seed see the same noise.
    scenario : Bai2016Scenario
        Spreads of what is random.

    """
    config, rng = case.simulated, np.random.default_rng(seed)
    misalignment = np.tile(ARCMIN * np.array(scenario.misalignment_arcmin), (runs, 1))
    frequency = np.full(runs, config.vibration_frequency)
    phase = np.full(runs, radians(config.vibration_phase_deg))
    if case.random:
        misalignment = rng.normal(size=(runs, 3)) * np.multiply(
            ARCMIN, scenario.misalignment_sd_arcmin)
        frequency = rng.uniform(scenario.lowest, scenario.highest, runs)
        phase = rng.uniform(0.0, 2 * pi, runs)
    sensors = CatapultSensors(config, rng, misalignment, frequency, phase)
    steps = round((config.hold + config.stroke) * config.rate)
    data = sensors.measure(0, steps + 1)
    dt, launch = 1 / config.rate, round(config.hold * config.rate) + 1
    earth, mat_track = Earth(radians(config.latitude_deg)), sensors.launch.mat_track
    mat_r = np.diag(np.square([config.ldv_sd, config.track_lateral_sd, config.track_vertical_sd]))
    arm = config.lever_arm + case.arm_sd * rng.normal(size=(runs, 3))
    silent_from, silent_to = (config.hold + edge for edge in case.silent)

    def reference(k: int, way: Array) -> Array:
        mat = data.mat_master[k]
        rate = data.master_rate[k] if k < 1 else (
            3 * data.master_rate[k] - data.master_rate[k - 1]) / 2
        return reference_velocity(mat, rate - mat.T @ earth.rate, data.velocity[k],
                                  arm + way[:, None] * mat_track[:, 0], mat_track[:, 0],
                                  data.speed[k])

    way = np.zeros(runs)
    mat = data.mat_master[0]
    axes = mat @ mat_track
    first = ARCMIN * np.array(case.first_sd_arcmin)
    transfer = TransferFilter(
        case.model, earth, np.tile(mat, (runs, 1, 1)), reference(0, way),
        mat @ np.diag(first**2) @ mat.T, axes @ mat_r @ axes.T if case.velocity_sd is None
        else case.velocity_sd**2 * np.eye(3))
    for k in range(1, steps + 1):
        if k == launch:
            transfer.launch()
            for direction in case.lost:
                vec = FORGOTTEN * axes @ direction
                transfer.cov[..., VEL, VEL] += np.outer(vec, vec)
        transfer.integrate(data.slave_rate[k], data.slave_force[k], dt)
        way = way + dt * (data.speed[k] + data.speed[k - 1]) / 2
        transfer.step(reference(k, way), data.mat_master[k] @ mat_track, mat_r,
                      ACROSS if silent_from <= data.times[k] < silent_to else ALL)
    true = sensors.launch.attitude(data.times[-1:])[0] @ rotation_matrix(misalignment)
    error = rotation_vectors(true.swapaxes(-1, -2) @ transfer.mat)
    return Outcome(error / ARCMIN, transfer.attitude_cov() / ARCMIN**2)


def cases(scenario: Bai2016Scenario) -> dict[str, Case]:
    """Name every Monte Carlo of the experiment."""
    launch = CatapultSimulatorConfig(
        deck='steady', rate=1 / scenario.dt, hold=scenario.hold, stroke=scenario.stroke,
        sampling='points', track_lateral_sd=0.01, track_vertical_sd=0.01)
    at_once = replace(launch, hold=0.0)
    default, plain = (transfer_model(AlignmentConfig(method=method))
                      for method in ('strong_tracking', 'kalman'))
    paper = transfer_model(AlignmentConfig(method='paper'))
    unfaded = replace(paper, tracking=None)
    single = replace(paper, tracking=StrongTracking((1.0,) * 6), feedback=True)
    preset: dict[str, Any] = {
        'random': False, 'first_sd_arcmin': (scenario.paper_misalignment_sd_arcmin,) * 3,
        'velocity_sd': scenario.paper_velocity_sd}
    found = {}
    for size in scenario.amplitudes:
        shaken = replace(launch, vibration=size)
        wide = replace(shaken, track_lateral_sd=0.02, track_vertical_sd=0.05)
        for name, model in (('kalman', unfaded), ('strong_tracking', paper)):
            found[f'paper_{name}_{size:g}'] = Case(
                replace(at_once, vibration=size), model, **preset)
        found |= {
            f'default_{size:g}': Case(shaken, default),
            f'default_skew_{size:g}': Case(replace(shaken, skew=scenario.skew), default),
            f'default_track_{size:g}': Case(wide, default),
            f'default_track_skew_{size:g}': Case(replace(wide, skew=scenario.skew), default),
            f'velocity_fading_{size:g}': Case(
                shaken, replace(plain, tracking=StrongTracking((0.0,) * 3 + (1.0,) * 3)))}
        if size in (0.0, scenario.amplitudes[-1]):
            rolling = replace(shaken, deck_roll_deg=3.0, deck_roll_period=12.0,
                              lever_arm=(0.0, 20.0, 0.0))
            found |= {
                f'plain_{size:g}': Case(shaken, plain), f'plain_track_{size:g}': Case(wide, plain),
                f'rolling_{size:g}': Case(rolling, default, arm_sd=0.01),
                f'dropout_{size:g}': Case(shaken, default, silent=(0.2, 0.5)),
                f'increments_default_{size:g}': Case(
                    replace(shaken, sampling='increments'), default),
                f'increments_plain_{size:g}': Case(
                    replace(shaken, sampling='increments'), plain),
                f'increments_kalman_{size:g}': Case(replace(
                    at_once, vibration=size, sampling='increments'), unfaded, **preset)}
            found |= {f'window_{hold:g}s_{size:g}': Case(replace(shaken, hold=hold), default)
                      for hold in (0.0, 1.0, 5.0)}
    strongest = replace(at_once, vibration=scenario.amplitudes[-1])
    wide = replace(launch, track_lateral_sd=0.02, track_vertical_sd=0.05)
    top = replace(wide, vibration=scenario.amplitudes[-1])
    return found | {
        **{f'other_{name}': Case(replace(top, **change), default)
           for name, change in OTHERS.items()},
        **{f'lost_{name}{track}': Case(simulated, plain, lost=lost)
           for name, lost in LOST.items()
           for track, simulated in (('', launch), ('_track', wide))},
        'aliasing_sine': Case(replace(strongest, vibration_phase_deg=-90.0), unfaded, **preset),
        'aliasing_random': Case(strongest, unfaded, **{**preset, 'random': True}),
        'aliasing_increments_sine': Case(replace(
            strongest, vibration_phase_deg=-90.0, sampling='increments'), unfaded, **preset),
        'single_factor': Case(strongest, single, **preset)}


def bai2016(runs: int | None = None) -> list[Row]:
    """
    Run Bai2016's experiment: errors of the attitude at the end of the stroke, in arcminutes.

    Parameters
    ----------
    runs : int, optional
        Instead of the scenario's.

    """
    scenario = Bai2016Scenario()
    if runs is not None:
        scenario = replace(scenario, runs=runs)
    found = {name: monte_carlo(case, scenario.runs, scenario.seed, scenario)
             for name, case in cases(scenario).items()}
    return [*_paper(scenario, found), *_explained(scenario, found), *_default(scenario, found)]


def _row(name: str, value: Any, unit: str = 'arcmin', printed: float | None = None,
         floor: float | None = None) -> Row:
    return Row('Bai2016', name, float(value), unit, printed, floor)


def _paper(scenario: Bai2016Scenario, found: Mapping[str, Outcome]) -> Iterator[Row]:
    """Yield the paper's table beside ours: mean, RMS and 95 % of the absolute error."""
    for k, size in enumerate(scenario.amplitudes):
        for method, table in PRINTED.items():
            outcome = found[f'paper_{method}_{size:g}']
            for axis, index in AXES.items():
                name, errors = f'paper_{method}_{axis}_{size:g}', outcome.absolute[:, index]
                yield _row(name, errors.mean(), printed=table[axis][k - 1] if k else None)
                yield _row(f'{name}_rms', outcome.rms[index])
                yield _row(f'{name}_95', np.quantile(errors, 0.95))
        kalman, tracking = (found[f'paper_{method}_{size:g}'].absolute[:, 1].mean()
                            for method in PRINTED)
        yield _row(f'paper_gain_{size:g}', kalman / tracking, '')


def _explained(scenario: Bai2016Scenario, found: Mapping[str, Outcome]) -> Iterator[Row]:
    """Yield what the table is made of, and what velocity cannot show."""
    top = f'{scenario.amplitudes[-1]:g}'
    yield _row(f'aliasing_cosine_pitch_{top}', found[f'paper_kalman_{top}'].rms[1])
    for name in ('sine', 'random', 'increments_sine'):
        yield _row(f'aliasing_{name}_pitch_{top}', found[f'aliasing_{name}'].rms[1])
    quiet, shaken = (found[f'increments_kalman_{size}'].rms[1] for size in ('0', top))
    yield _row(f'increments_kalman_pitch_{top}', shaken)
    yield _row('increments_kalman_ratio', shaken / quiet, '')
    yield _row(f'single_factor_roll_{top}', found['single_factor'].rms[0])
    for size in ('0', top):
        alone = found[f'window_0s_{size}']
        for axis, index in AXES.items():
            yield _row(f'no_window_{axis}_{size}', alone.rms[index])
            yield _row(f'no_window_{axis}_{size}_sd', alone.sd[index])
        _, vectors = np.linalg.eigh(alone.cov)
        angles = np.arccos(np.minimum(np.abs(vectors[..., 2] @ UNOBSERVABLE), 1))
        yield _row(f'no_window_direction_{size}', degrees(float(np.mean(angles))), 'deg')
        for hold in ('1', '5'):
            for axis, index in AXES.items():
                yield _row(f'window_{hold}s_{axis}_{size}',
                           found[f'window_{hold}s_{size}'].rms[index])


def _default(scenario: Bai2016Scenario, found: Mapping[str, Outcome]) -> Iterator[Row]:
    """
    Yield the default filter's errors; floor: what the undisturbed filter knows of itself.

    Between them ``lost``, undisturbed but with the velocity forgotten at the launch: in a line,
    as whoever does not know how much it is shaken must; in a plane, as whoever does not know
    either how late the reference is, and takes nothing from the force.
    """
    bounds = {'': found['plain_0'], '_track': found['plain_track_0']}
    for track, bound in bounds.items():
        for axis, index in AXES.items():
            yield _row(f'undisturbed{track}_{axis}', bound.rms[index], floor=bound.sd[index])
            for name in LOST:
                yield _row(f'lost_{name}{track}_{axis}',
                           found[f'lost_{name}{track}'].rms[index], floor=bound.sd[index])
        for size in scenario.amplitudes:
            for skew in ('', '_skew'):
                name = f'default{track}{skew}'
                outcome = found[f'{name}_{size:g}']
                for axis, index in AXES.items():
                    yield _row(f'{name}_{axis}_{size:g}', outcome.rms[index],
                               floor=bound.sd[index])
                    yield _row(f'{name}_{axis}_{size:g}_sd', outcome.sd[index])
                    yield _row(f'{name}_{axis}_{size:g}_ratio',
                               outcome.rms[index] / bound.rms[index], '')
                yield _row(f'{name}_nees_{size:g}', outcome.nees, '')
    top = f'{scenario.amplitudes[-1]:g}'
    for name in ('rolling', 'dropout', 'increments_default'):
        for shaken in ('0', top):
            outcome, usual = found[f'{name}_{shaken}'], found[f'default_{shaken}']
            for axis, index in AXES.items():
                yield _row(f'{name}_{axis}_{shaken}', outcome.rms[index],
                           floor=bounds[''].sd[index])
                yield _row(f'{name}_{axis}_{shaken}_ratio',
                           outcome.rms[index] / usual.rms[index], '')
    for name in OTHERS:
        outcome = found[f'other_{name}']
        for axis, index in AXES.items():
            yield _row(f'other_{name}_{axis}_{top}', outcome.rms[index],
                       floor=bounds['_track'].sd[index])
            yield _row(f'other_{name}_{axis}_{top}_sd', outcome.sd[index])
    for name in ('plain', 'increments_plain'):
        yield _row(f'{name}_pitch_{top}', found[f'{name}_{top}'].rms[1], floor=bounds[''].sd[1])
    for size in scenario.amplitudes:
        yield _row(f'velocity_fading_pitch_{size:g}', found[f'velocity_fading_{size:g}'].rms[1],
                   floor=bounds[''].sd[1])
