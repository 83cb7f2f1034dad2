"""How each kind of fault is made, and ended."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, NamedTuple, cast

from numpy.random import Generator

from twinscrew.hil_sim.autopilot.parameters import Parameters
from twinscrew.hil_sim.drivers.realtime import RealtimeCrew
from twinscrew.hil_sim.faults.ais import LyingStation
from twinscrew.hil_sim.faults.effects import (
    Corrupting,
    Delaying,
    Dropping,
    Duplicating,
    Effect,
    Reordering,
)
from twinscrew.hil_sim.faults.ids import Impersonating
from twinscrew.hil_sim.faults.kinds import KINDS, MAVLINK, Cut, Hog, Parameter, Pilot
from twinscrew.hil_sim.faults.line import Line
from twinscrew.hil_sim.faults.plan import Fault
from twinscrew.hil_sim.faults.rig import Rig
from twinscrew.hil_sim.faults.sensing import Freezing, Jumping, NoisyOdometry, NoisyPoints
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages import cdr

BUSY = "import os; os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))\nwhile True: pass"
"""A program like any other, whatever priority the simulator has."""


LOOKING = """
import os, signal, sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("transport/shared_memory/enabled", "false")
config.insert_json5("transport/link/tx/lease", "1000")  # [ms] after which it is given up
with zenoh.open(config) as session:
    heard = session.declare_subscriber("**", lambda sample: os.kill(os.getpid(), signal.SIGSTOP))
    time.sleep(1000)
"""
"""A program that asks for everything, and stops at the first that it gets."""


class Action(NamedTuple):
    """What begins a fault, and what ends it."""

    begin: Callable[[], None]
    end: Callable[[], None]


def action_of(fault: Fault, rig: Rig, crew: RealtimeCrew, rng: Generator) -> Action:
    """Give what makes a fault of one vessel.

    Parameters
    ----------
    fault
        As `load_plan` checked it.
    rng
        What lots are drawn from.
    """
    given = cast("Any", fault.settings())
    vessel = rig.vessel
    if rig.thrusters is not None and fault.target in ("autopilot", *MAVLINK):
        words = f"{fault.target}: of thrusters by topic there is no autopilot"
        raise ConfigError(words, key="fault.target")
    match fault.kind, fault.target:
        case "kill", "runtime":
            return Action(lambda: crew.kill(vessel), lambda: crew.start_again(vessel))
        case "hang", "runtime":
            return _hang(lambda number: crew.signal(vessel, number))
        case "kill", _:
            return Action(rig.autopilot.kill, rig.autopilot.start)
        case "hang", _:
            return _hang(rig.autopilot.signal)
        case "frozen_subscriber", _:
            return _programs(lambda: (LOOKING, crew.endpoint), given.processes)
        case "cut", _:
            return _cut(rig, given)
        case "cpu_hog", _:
            return _hog(given)
        case "pilot", _:
            return _pilot(rig, given)
        case "parameter", _:
            return _parameter(rig, given)
        case "streams", _:
            return Action(lambda: rig.autopilot.request_streams(given.rate_hz), _nothing)
        case "push", _:
            return Action(lambda: rig.push((given.north_n, given.east_n)), lambda: rig.push((0, 0)))
        case "silence", _:
            return Action(
                lambda: rig.autopilot.let_station_speak(False),
                lambda: rig.autopilot.let_station_speak(True),
            )
        case "goal", _:
            return Action(lambda: crew.deliver(vessel, "goal", rig.goal, 0.0), _nothing)
        case "disable", _:
            off = cdr.encode_enable(False)
            return Action(lambda: crew.deliver(vessel, "enable", off, 0.0), _nothing)
    return _on_lines(fault, rig, rng)


def effect_of(
    kind: str, target: str, given: Any, rng: Generator, last: bytes | None = None
) -> Effect:
    """Give what a fault does to the messages of one line, of which one was the last before it."""
    match kind:
        case "drop":
            return Dropping(given.share, rng)
        case "delay":
            return Delaying(given.delay_s)
        case "duplicate":
            return Duplicating(given.copies)
        case "reorder":
            return Reordering(given.share, rng)
        case "corrupt":
            return Corrupting(given, rng)
        case "freeze":
            return Freezing(last, stamps_move=given.stamps == "moving")
        case "clock_jump":
            return Jumping(given)
        case "ais":
            return LyingStation(given, rng)
        case "wrong_ids":
            return Impersonating(given)
        case "noise":
            return NoisyPoints(given, rng) if target == "points" else NoisyOdometry(given, rng)
    raise ValueError(f"{kind} is nothing that a line can do; those are in {sorted(KINDS)}")


def _on_lines(fault: Fault, rig: Rig, rng: Generator) -> Action:
    names = {id(line): name for name, line in rig.lines.items()}
    made: list[tuple[Line, Effect]] = []

    def begin() -> None:
        for line in rig.lines_of(fault.target):
            name, given = names[id(line)], fault.settings()
            made.append((line, effect_of(fault.kind, name, given, rng, line.last)))
            line.add(made[-1][1])

    def end() -> None:
        for line, effect in made:
            line.remove(effect)

    return Action(begin, end)


def _hang(send: Callable[[signal.Signals], None]) -> Action:
    return Action(lambda: send(signal.SIGSTOP), lambda: send(signal.SIGCONT))


def _cut(rig: Rig, given: Cut) -> Action:
    return Action(lambda: rig.proxy.cut(silently=given.silently), lambda: rig.proxy.mend())


def _hog(given: Hog) -> Action:
    return _programs(lambda: (BUSY,), given.processes)


def _programs(words: Callable[[], tuple[str, ...]], count: int) -> Action:
    """Run a program of Python's, and what follows it, several times meanwhile."""
    running: list[subprocess.Popen[bytes]] = []

    def begin() -> None:
        command = [sys.executable, "-c", *words()]
        running.extend(subprocess.Popen(command) for _ in range(count))

    def end() -> None:
        for program in running:
            program.kill()
        for program in running:
            program.wait()

    # Aside: to start and bury programs takes longer than the simulator can wait.
    return Action(_aside(begin), _aside(end))


def _aside(do: Callable[[], None]) -> Callable[[], None]:
    return lambda: threading.Thread(target=do, daemon=True).start()


def _pilot(rig: Rig, given: Pilot) -> Action:
    return Action(lambda: rig.autopilot.act(given.does), _nothing)


def _parameter(rig: Rig, given: Parameter) -> Action:
    right = Parameters(rig.system_id, {given.name: given.value}) and Parameters(rig.system_id, {})
    return Action(
        lambda: rig.autopilot.set_parameter(given.name, given.value),
        lambda: rig.autopilot.set_parameter(given.name, right[given.name]),
    )


def _nothing() -> None:
    pass
