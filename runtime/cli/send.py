"""`twinscrew send`: gives a boat goals, and lets it drive, where there is no ROS 2 to do it.

The messages are those of `ros2 topic pub`; docs/ros2.md shows both.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

if TYPE_CHECKING:
    from twinscrew.runtime.bus.zenoh import ZenohBus

app = typer.Typer(
    help="Give a boat goals, and let it drive: what `ros2 topic pub` does, without ROS 2.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
FOUND_S: Final = 5.0
"""[s] How long to look for somebody who listens."""
ENABLE_EVERY_S: Final = 0.2
"""[s] Between two enables: five fit into the time after which a boat stops."""
ANSWER_S: Final = 1.0
"""[s] How long to wait for the boat's word on a goal; it comes within a scan or a tick."""
TAKEN: Final = ("goal_set", "station_set", "berth_set")
"""Events by which a boat says that it has taken an order; those by which it refuses one:"""
REFUSED: Final = ("goal_forbidden", "goal_frame", "station_refused")
FLUSH_S: Final = 0.1
"""[s] For what was sent last to leave."""

Config = Annotated[
    Path | None,
    typer.Option(help="The boat's TOML file: its name, and how its bus is reached."),
]


@app.command()
def goal(
    x: Annotated[float, typer.Argument(help="[m] In the frame: east, if that is the odometry's.")],
    y: Annotated[float, typer.Argument(help="[m] North; of base_link: to port.")],
    config: Config = None,
    frame: Annotated[str, typer.Option(help="Frame of x and y; the odometry's without it.")] = "",
) -> None:
    """Send a goal (geometry_msgs/PoseStamped), in the place of all before."""
    import numpy as np

    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.messages import cdr
    from twinscrew.runtime.messages.types import Goal

    if not (abs(x) < 1e8 and abs(y) < 1e8):
        raise ConfigError(f"{x}, {y} is no place on the water", key="goal")
    place = Goal(stamp_ns=0, position_N=np.array([y, x]))  # stamp 0: now, as in ROS
    with _bus(config, "goal") as bus, _answer(bus):
        bus.publish("goal", cdr.encode_goal(place, frame_id=frame))


@app.command()
def hold(
    north: Annotated[float, typer.Option(help="[m] North of the local frame's origin.")],
    east: Annotated[float, typer.Option(help="[m] East of it.")],
    heading: Annotated[
        float | None,
        typer.Option(help="[deg] Where the bow is to point; without it into wind and current."),
    ] = None,
    config: Config = None,
) -> None:
    """Send a place to stay at (geometry_msgs/PoseStamped), in the place of all goals before."""
    import math

    import numpy as np

    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.messages import cdr
    from twinscrew.runtime.messages.types import Station

    if not (abs(north) < 1e8 and abs(east) < 1e8):
        raise ConfigError(f"north {north}, east {east} is no place on the water", key="hold")
    if heading is not None and not abs(heading) <= 360.0:
        raise ConfigError(f"must be in [-360, 360] deg, got {heading:g}", key="--heading")
    bow = None if heading is None else math.radians(heading)
    place = Station(stamp_ns=0, position_N=np.array([north, east]), heading=bow)
    with _bus(config, "hold") as bus, _answer(bus):
        bus.publish("hold", cdr.encode_station(place))


@app.command()
def berth(
    from_north: Annotated[float, typer.Option(help="[m] One end of the face: north.")],
    from_east: Annotated[float, typer.Option(help="[m] East.")],
    to_north: Annotated[float, typer.Option(help="[m] The end to which the bow points: north.")],
    to_east: Annotated[float, typer.Option(help="[m] East.")],
    config: Config = None,
) -> None:
    """Send a face to lie at (a nav_msgs/Path of two places); the side is the boat's present one."""
    import numpy as np

    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.messages import cdr

    face = np.array([[from_north, from_east], [to_north, to_east]])
    if not (np.abs(face) < 1e8).all() or (face[0] == face[1]).all():
        raise ConfigError(f"{face.tolist()} is no face on the water", key="berth")
    with _bus(config, "berth") as bus, _answer(bus):
        bus.publish("berth", cdr.encode_path(face, stamp_ns=0, frame_id=""))


@app.command()
def stop(config: Config = None) -> None:
    """Take all goals back (an empty nav_msgs/Path): the boat stops."""
    import numpy as np

    from twinscrew.runtime.messages import cdr

    with _bus(config, "route") as bus:
        bus.publish("route", cdr.encode_path(np.empty((0, 2)), stamp_ns=0, frame_id=""))


@app.command()
def enable(
    config: Config = None,
    once: Annotated[bool, typer.Option("--once", help="Say it once, and end.")] = False,
) -> None:
    """Let a boat drive that takes newtons by topic (std_msgs/Bool), until Ctrl-C; then stop it."""
    from twinscrew.runtime.messages import cdr

    with _bus(config, "enable") as bus:
        try:
            bus.publish("enable", cdr.encode_enable(True))
            while not once:
                time.sleep(ENABLE_EVERY_S)
                bus.publish("enable", cdr.encode_enable(True))
        except KeyboardInterrupt:
            bus.publish("enable", cdr.encode_enable(False))


@app.command()
def disable(config: Config = None) -> None:
    """Stop a boat that takes newtons by topic, at once."""
    from twinscrew.runtime.messages import cdr

    with _bus(config, "enable") as bus:
        bus.publish("enable", cdr.encode_enable(False))


@contextmanager
def _answer(bus: ZenohBus) -> Iterator[None]:
    """Wait for the boat's word on what is sent meanwhile; a refusal is raised in its words."""
    from queue import Empty, SimpleQueue

    from twinscrew.runtime.bus.base import Received
    from twinscrew.runtime.errors import MessageError, TwinscrewError
    from twinscrew.runtime.messages import cdr
    from twinscrew.runtime.messages.types import HealthEvent

    said: SimpleQueue[HealthEvent] = SimpleQueue()

    def hear(message: Received) -> None:
        with suppress(MessageError):
            for event in cdr.decode_diagnostics(message.payload):
                if event.name in (*TAKEN, *REFUSED):
                    said.put(event)

    bus.subscribe("diagnostics", hear)
    yield
    try:
        event = said.get(timeout=ANSWER_S)
    except Empty:
        return  # it was heard, but a boat need not tell
    if event.name in REFUSED:
        raise TwinscrewError(f"refused ({event.name}): {event.detail}")


@contextmanager
def _bus(config: Path | None, topic: str) -> Iterator[ZenohBus]:
    """Open a boat's bus, and wait until somebody hears a topic of it."""
    from msgspec.structs import replace

    from twinscrew.runtime.bus.zenoh import ZenohBus
    from twinscrew.runtime.errors import BusError
    from twinscrew.runtime.vessel.config import RuntimeConfig, load_config

    settings = RuntimeConfig() if config is None else load_config(config)
    # A client needs somebody there at once, and hears everybody behind them.
    zenoh = replace(settings.bus, mode="client", listen=(), node="")
    with closing(ZenohBus(zenoh, settings.name)) as bus:
        if not bus.wait_for_subscribers((topic,), FOUND_S):
            name = f"/{settings.name}/{zenoh.topic(topic).key}"
            raise BusError(f"nobody hears {name}: is the runtime of {settings.name} running?")
        yield bus
        time.sleep(FLUSH_S)
