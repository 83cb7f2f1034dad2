"""Coming alongside: a whole pipeline's task, its orders and its refusals."""

import math

import numpy as np
import pytest
from tests.harness.boat import Boat, Steady, cloud, make_pipeline, odometry

from twinscrew.hil_sim.odometry import OdometrySettings, measure
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.runtime.charts.static_map import Area
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Berth, Fallback, Station, Tracks
from twinscrew.runtime.safety.assurance import without_face
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.vessel.station import Berthing, Keeper, Phase, StationSettings
from twinscrew.runtime.vessel_description import load_vessel

HERON = load_vessel("heron")
LIMITS = ThrustLimits(HERON.thrusters.min_n, HERON.thrusters.max_n)
FACE = np.array([[-2.0, 0.0], [2.0, 0.0]])  # along north; the boat lies east or west of it


def tracks(*rows: tuple[float, float, float, float]) -> Tracks:
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    count = len(table)
    return Tracks(
        stamp_ns=0,
        id=np.arange(count),
        p_N=table[:, :2],
        v_N=table[:, 2:],
        radius=np.full(count, 0.5),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )


class Water:
    """A hull in calm water that does what a berthing says."""

    def __init__(self, place: tuple[float, float], heading: float) -> None:
        self.sea = Sea(
            SeaSettings(waves=WaveSettings(gain=0.0), wind=WindSettings(mean_mps=0.0)),
            np.random.default_rng(0),
        )
        self.dynamics = VesselDynamics(HERON)
        self.body = at_rest(self.dynamics, np.array([place]), np.array([heading]))
        self.thrust, self.scans = np.zeros(2), 0

    @property
    def odometry(self):
        rng = np.random.default_rng(0)
        return measure(self.body, 0, self.scans * 100_000_000, OdometrySettings(), rng)

    def sail(self, berthing: Berthing, seconds: float, around: Tracks | None = None) -> list:
        said = []
        for _ in range(round(seconds / 0.1)):
            self.thrust, events = berthing.step(self.odometry, self.thrust, around)
            said += events
            if berthing.phase in (Phase.ALONGSIDE, Phase.GIVEN_UP):
                break
            for _ in range(5):
                self.body = self.dynamics.step(
                    self.body, self.thrust[None], self.sea, 0.1 * self.scans, 0.02
                )
            self.scans += 1
        return said


def berthing_of(place: tuple[float, float]) -> Berthing:
    keeper = Keeper(StationSettings(), HERON, LIMITS)
    return Berthing(keeper, Berth(stamp_ns=0, face_N=FACE), np.array(place))


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["face to port", "face to starboard"])
def test_in_calm_water_a_boat_comes_alongside_slowly_on_either_side(side):
    place = (-3.0, 5.0 * side)
    berthing, water = berthing_of(place), Water(place, 1.0)
    said = [event.name for event in water.sail(berthing, 200.0)]
    assert said == ["berth_approach", "berthed"]
    now = water.odometry
    assert np.hypot(*now.velocity_B[:2]) <= 0.2
    assert abs(now.heading) <= math.radians(12.0)
    assert abs(now.position_N[0]) <= 1.0
    gap = side * now.position_N[1] - 0.5 * HERON.beam_m * math.cos(now.heading)
    assert gap - 0.5 * HERON.length_m * abs(math.sin(now.heading)) <= 0.1


def test_a_vessel_in_the_way_ends_the_approach_and_the_boat_stands_off():
    berthing, water = berthing_of((-3.0, 5.0)), Water((-3.0, 5.0), 1.0)
    while berthing.phase is not Phase.APPROACH:
        water.sail(berthing, 1.0)
    place = water.odometry.position_N
    crossing = tracks((place[0] + 2.0, place[1], -1.0, 0.0))
    (aborted,) = water.sail(berthing, 0.1, crossing)
    assert aborted.name == "berth_aborted"
    assert "in the way" in aborted.detail
    assert berthing.phase is Phase.STAND_OFF


def test_only_what_stands_on_the_face_may_be_touched_and_only_while_coming_in():
    berthing = berthing_of((0.0, 5.0))
    on_face, moving_there = (0.5, -0.2, 0.0, 0.0), (0.5, -0.2, 0.0, 1.0)
    before_it, beyond_its_end = (0.5, 2.0, 0.0, 0.0), (4.0, -0.2, 0.0, 0.0)
    around = tracks(on_face, moving_there, before_it, beyond_its_end)
    assert berthing.others(around).id.tolist() == [0, 1, 2, 3]
    for phase in (Phase.APPROACH, Phase.LAND):
        berthing.phase = phase
        assert berthing.others(around).id.tolist() == [1, 2, 3]
    berthing.phase = Phase.STAND_OFF
    assert berthing.others(around).id.tolist() == [0, 1, 2, 3]


def test_after_as_many_tries_as_allowed_the_boat_stays_off():
    berthing = berthing_of((0.0, 5.0))
    names = []
    for number in range(1, 4):
        berthing.phase, berthing.tries = Phase.APPROACH, number
        (event,) = berthing.interrupt(0, "a test")
        names.append(event.name)
    assert names == ["berth_aborted", "berth_aborted", "berth_given_up"]
    assert berthing.interrupt(0, "again") == ()


def test_the_assurance_lets_go_of_the_face_alone():
    quay = np.array([[[-50.0, 0.1], [50.0, 0.1]], [[50.0, 0.1], [50.0, -9.0]]])
    left = without_face(quay, FACE)
    assert left.tolist() == [
        [[-50.0, 0.1], [-2.5, 0.1]],
        [[2.5, 0.1], [50.0, 0.1]],
        [[50.0, 0.1], [50.0, -9.0]],
    ]


def test_what_is_left_of_a_quay_beside_the_face_keeps_its_forbidden_side():
    northward = np.array([[[-50.0, 0.1], [50.0, 0.1]]])
    assert without_face(northward[:, ::-1], FACE).tolist() == [
        [[50.0, 0.1], [2.5, 0.1]],
        [[-2.5, 0.1], [-50.0, 0.1]],
    ]
    assert len(without_face(np.array([[[2.0, 0.1], [-2.4, 0.1]]]), FACE)) == 0


def boat_that_holds(**link: object) -> Boat:
    boat = Boat(waypoints_m=(), **link)
    boat.vessel.pipeline.keeper = Keeper(StationSettings(), load_vessel(), ThrustLimits())
    return boat


PLACE = cdr.encode_station(Station(stamp_ns=0, position_N=np.array([1.5, 0.0])))
BERTH = cdr.encode_path(np.array([[-8.0, 9.0], [8.0, 9.0]]), stamp_ns=0, frame_id="")


@pytest.mark.parametrize(("topic", "payload"), [("hold", PLACE), ("berth", BERTH)])
def test_an_order_is_carried_out_only_while_the_boat_is_engaged(topic, payload):
    boat = boat_that_holds(arm=False)
    boat.sail(3.0).take_in(topic, payload)
    boat.sail(3.0)
    assert {"station_set", "berth_set"} & set(boat.names)
    assert not boat.moves
    engaged = boat_that_holds()
    engaged.sail(3.0).take_in(topic, payload)
    engaged.sail(3.0)
    assert engaged.moves


def test_a_boat_that_holds_its_place_stops_without_odometry_and_goes_on_with_it():
    boat = boat_that_holds()
    boat.sail(3.0).take_in("hold", PLACE)
    boat.sail(2.0)
    assert boat.moves
    lost_s = boat.now_s
    boat.line = lambda topic, payload: () if topic == "odometry" else (payload,)
    boat.sail(1.0)
    assert boat.stopped_by(lost_s) <= 0.5
    boat.line = lambda topic, payload: (payload,)
    boat.sail(3.0)
    assert boat.moves


def test_a_berth_needs_two_ends_and_room_for_the_boat():
    boat = boat_that_holds()
    boat.sail(1.0)
    boat.take_in("berth", cdr.encode_path(np.zeros((1, 2)), stamp_ns=0, frame_id=""))
    assert "bad_message" in boat.names
    short = np.array([[0.0, 9.0], [1.0, 9.0]])
    boat.take_in("berth", cdr.encode_path(short, stamp_ns=0, frame_id=""))
    assert "station_refused" in boat.names
    assert boat.vessel.pipeline.mission.berth is None


def test_a_new_order_ends_a_berthing():
    boat = boat_that_holds()
    boat.sail(3.0).take_in("berth", BERTH)
    boat.sail(0.5)
    assert boat.vessel.pipeline.berthing is not None
    boat.take_in("hold", PLACE)
    boat.sail(0.5)
    assert boat.vessel.pipeline.berthing is None
    assert boat.vessel.pipeline.mission.station is not None


class ComesIn:
    """A pipeline that is on its way in to a berth; scans come while the boat is moved by hand."""

    def __init__(self) -> None:
        self.pipeline = make_pipeline(Steady(), ())
        self.pipeline.keeper = Keeper(StationSettings(), load_vessel(), ThrustLimits())
        self.time_s = 0.0
        face_N = np.array([[-8.0, 9.0], [8.0, 9.0]])
        self.pipeline.mission.set_berth(Berth(stamp_ns=0, face_N=face_N))
        self.scan((0.0, 0.0))
        self.berthing.phase, self.berthing.tries = Phase.APPROACH, 1
        self.scan(self.line_up)
        assert self.pipeline.assurance.berth_N is not None

    @property
    def berthing(self) -> Berthing:
        return self.pipeline.berthing

    @property
    def line_up(self) -> tuple[float, float]:
        return tuple(self.berthing.line_up_N.tolist())

    def scan(self, place: tuple[float, float], *, engaged: bool = True) -> list[str]:
        self.time_s += 0.1
        now = odometry(self.time_s, *place)
        decision, _ = self.pipeline.step(cloud(self.time_s), now, engaged=engaged)
        self.thrust = decision.thrust
        return [event.name for event in decision.events]


def test_a_way_in_is_broken_off_when_a_pilot_takes_over_and_the_face_is_kept_clear_of_again():
    boat = ComesIn()
    assert "berth_aborted" in boat.scan(boat.line_up, engaged=False)
    assert boat.berthing.phase is Phase.STAND_OFF
    assert boat.pipeline.assurance.berth_N is None
    assert "berth_aborted" not in boat.scan((-100.0, 0.0))
    assert boat.pipeline.assurance.berth_N is None


def test_a_way_in_is_broken_off_when_the_place_is_to_be_held():
    boat = ComesIn()
    boat.pipeline.mission.hold(odometry(boat.time_s, *boat.line_up))
    assert "berth_aborted" in boat.scan(boat.line_up)
    assert boat.pipeline.assurance.berth_N is None


def test_one_scan_that_shows_nothing_does_not_break_off_a_way_in():
    boat = ComesIn()
    boat.pipeline.perception.step = lambda *_, **__: (_ for _ in ()).throw(MessageError("bad"))
    assert "perception_error" in boat.scan(boat.line_up)
    assert not boat.thrust.any()
    assert boat.berthing.phase is Phase.APPROACH


def test_a_boat_that_lay_alongside_rests_until_it_is_given_an_order():
    boat = ComesIn()
    boat.berthing.phase = Phase.ALONGSIDE
    for place in (boat.line_up, (-100.0, 0.0), (-100.0, 0.0)):
        boat.scan(place)
        assert not boat.thrust.any()
        assert not boat.pipeline.has_task
    boat.pipeline.mission.set_station(Station(stamp_ns=0, position_N=np.zeros(2)))
    boat.scan((-100.0, 0.0))
    assert boat.pipeline.has_task


def test_outside_the_envelope_a_boat_that_comes_in_holds_its_place():
    boat = boat_that_holds()
    boat.sail(3.0).take_in("berth", BERTH)
    boat.sail(0.5)
    boat.place = tuple(boat.vessel.pipeline.berthing.line_up_N.tolist())
    boat.sail(0.5)
    mission = boat.vessel.pipeline.mission
    assert mission.berths
    hold = Fallback(stamp_ns=boat.vessel.stamp_ns, response="hold", reason="a test")
    boat.take_in("fallback", cdr.encode_fallback(hold))
    assert mission.holds
    assert not mission.berths


def test_a_berth_that_was_ordered_before_the_first_odometry_is_not_taken_back():
    boat = boat_that_holds()
    quay = np.array([[-20.0, 9.0], [20.0, 9.0], [20.0, 30.0], [-20.0, 30.0]])
    assert boat.vessel.fence("station", (Area(kind="land", outline=quay),)) == ""
    boat.take_in("berth", BERTH)
    boat.sail(1.0)
    assert "goal_forbidden" not in boat.names
    assert boat.vessel.pipeline.berthing is not None


def test_that_a_heading_cannot_be_held_is_said_of_each_order():
    keeper = Keeper(StationSettings(), load_vessel(), ThrustLimits())
    said = []
    for k in range(600):  # it lies still under thrust ahead: the drift comes from ahead
        heading = math.radians(90.0 if k < 300 else 80.0)
        station = Station(stamp_ns=0, position_N=np.zeros(2), heading=heading)
        _, events = keeper.step(odometry(0.1 * k), np.array([100.0, 100.0]), station)
        said += [event.detail.split(" deg")[0] for event in events]
    assert said == ["asked 90", "asked 80"]
