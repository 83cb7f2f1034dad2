from twinscrew.runtime.safety.events import LIDAR_STALE, ODOMETRY_STALE
from twinscrew.runtime.safety.guard import Watchdog


def make() -> Watchdog:
    return Watchdog({"points": (LIDAR_STALE, 0.4), "odometry": (ODOMETRY_STALE, 0.3)})


def test_everything_is_stale_before_it_was_heard() -> None:
    dog = make()
    dog.check(0.0, 0)
    assert set(dog.stale) == {"points", "odometry"}
    assert not dog.all_heard


def test_a_stale_input_is_named_once_and_its_recovery_once() -> None:
    dog = make()
    for name in ("points", "odometry"):
        dog.seen(name, 1, 0.0)
    assert {e.name for e in dog.check(0.1, 10)} == {"input_recovered"}
    assert dog.stale == ()
    dog.seen("odometry", 2, 0.35)
    (event,) = dog.check(0.5, 20)
    assert event.name == "lidar_stale"
    assert "0.50 s old, allowed 0.4 s" in event.detail
    assert dog.check(0.55, 21) == []
    dog.seen("points", 3, 0.6)
    assert [e.name for e in dog.check(0.61, 30)] == ["input_recovered"]


def test_a_frozen_sensor_is_as_stale_as_a_silent_one() -> None:
    dog = make()
    for k in range(20):
        dog.seen("points", 7, 0.1 * k)
        dog.seen("odometry", k, 0.1 * k)
        dog.check(0.1 * k, 0)
    assert dog.stale == ("points",)


def test_topics_that_are_not_watched_do_not_matter() -> None:
    dog = make()
    dog.seen("goal", 1, 0.0)
    assert not dog.all_heard
