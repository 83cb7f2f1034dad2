"""Puts the parts of one vessel's runtime together from its configuration."""

from __future__ import annotations

from twinscrew.runtime.app.config import RuntimeConfig, autopilot_of, sensor_of
from twinscrew.runtime.app.controller import Controller
from twinscrew.runtime.app.core import Core
from twinscrew.runtime.app.mission import Mission
from twinscrew.runtime.app.odometry_source import (
    Alignment,
    AutopilotOdometry,
    GpsImuOdometry,
    OdometrySource,
)
from twinscrew.runtime.app.pipeline import Pipeline
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.guard import Guard
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel_description import load_vessel


def make_core(config: RuntimeConfig) -> Core:
    """Make the core: sensor, perception, tracker, policy, mission.

    Raises
    ------
    ConfigError, PolicyError
        Something configured does not exist or cannot be used: before anything moves.
    """
    sensor = sensor_of(config)
    pipeline = Pipeline(
        perception=Perception(sensor, config.perception),
        tracker=Tracker(config.tracking, SensorView.of(sensor)),
        policy=load_policy(
            config.policy, expected_of_policies(config), config.risk, load_vessel(config.vessel)
        ),
        mission=Mission(config.mission),
        guard=Guard(config.thrust),
        observation=config.observation,
        assurance=Assurance(config.assurance, config.thrust),
    )
    return Core(pipeline, config.odometry)


def expected_of_policies(config: RuntimeConfig) -> PolicyExpectation:
    """Give what a policy must have been trained with, to be the vessel's."""
    return PolicyExpectation(
        thrust_min_n=config.thrust.min_n,
        thrust_max_n=config.thrust.max_n,
        perception_range_m=config.perception.max_range_m,
        vessel=load_vessel(config.vessel).name,
    )


def make_controller(config: RuntimeConfig, *, looks_first: bool = True) -> Controller:
    """Make everything of a vessel's runtime but its sockets and its clock; see `Controller`."""
    autopilot = autopilot_of(config)
    us = (autopilot.system_id, autopilot.component_id)
    stations = Stations(config.ground.orders, autopilot.datum, us)
    link = AutopilotLink(autopilot, stations=stations)
    source = odometry_source(config, link)
    return Controller(make_core(config), link, source, looks_first=looks_first)


def odometry_source(config: RuntimeConfig, link: AutopilotLink) -> OdometrySource | None:
    """Make what odometry comes from; None if that is the bus."""
    if config.odometry_source == "autopilot":
        return AutopilotOdometry(link, Alignment(config.alignment))
    if config.odometry_source == "gps_imu":
        return GpsImuOdometry(config.estimation)
    return None
