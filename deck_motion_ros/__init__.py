"""
Know where the deck will be.

Conventions, stated once and kept everywhere:

Axes
    REP-103: body x forward, y left, z up; world east, north, up. Roll is positive port side up,
    pitch positive bow **down**, yaw positive counter-clockwise from east. Only
    :mod:`deck_motion_ros.geometry` flips an axis.
Units
    SI and radians inside. A suffix (``_deg``, ``_cm``, ``_arcmin``) appears only at the door:
    in reports, on the command line and in the tests of a paper's figures.
Time
    Samples carry ``stamp``, integer nanoseconds, so that streams are joined exactly. Durations
    inside an estimator are float seconds. No estimator sees a clock.
Uncertainty
    ``sd``, ``var``, ``cov`` and ``psd`` say which is meant. Covariances are those of the error of
    the estimate, not of the motion.
Rest
    Roll = pitch = heave = 0. Trim is part of the height; an axis that never came counts as 0.

Rooms, each looking only down
    nodes, cli, demo, bench
        the roof: the only rooms that know ROS (``nodes``) or a terminal
    evaluation, documentation
        metrics, the papers' experiments, the report; the document of topics and parameters
    importers, replaying
        recorded logs into bags; a bag through a pipeline
    scenarios, recording, pipelines, params_file
        frozen experiments; bags in and out; message in, messages out; parameter files
    estimators, simulation, messages, profile_file
        siblings that do not know each other; all but the file of a ship profile are pure
    streams, processes, blas, earth, geometry, config, topics, names, samples
        the ground floor: numpy and scipy only
"""

__version__ = '0.1.0'
