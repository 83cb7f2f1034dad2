"""`sitl --ground`: what goes with a ground station, and what does not."""

import socket

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.drivers.realtime import simulated_fleet
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.runtime.errors import ConfigError, LinkError
from twinscrew.runtime.mavlink import Wire


def test_a_ground_station_cannot_follow_lock_step() -> None:
    scenario = load_scenario("head_on", None, None, 0)
    with pytest.raises(ConfigError, match="without --lockstep"):
        sail(scenario, SitlSettings(lockstep=True, ground="127.0.0.1:14550"))


def test_every_vessel_calls_the_station_as_itself() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(5.0)
        fleet = simulated_fleet([1, 2], ground=f"127.0.0.1:{station.getsockname()[1]}")
        try:
            for vessel in (0, 1):
                fleet.exchange(vessel, 0.1, None)
            heard = [m for _ in range(2) for m in Wire(255, 190).decode(station.recv(2048))]
        finally:
            fleet.close()
    beats = [m for m in heard if m.get_msgId() == mavlink.MAVLINK_MSG_ID_HEARTBEAT]
    assert {m.get_srcSystem() for m in beats} == {1, 2}


def test_an_address_that_is_none_is_refused() -> None:
    with pytest.raises(LinkError, match="14550"):
        simulated_fleet([1], ground="14550")
