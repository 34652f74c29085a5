# SPDX-License-Identifier: Apache-2.0
"""fcsl bus: machines on the bus, from the command line (docs/reference/transports.md)."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any

from fcsl_compiler.api.command_line import add_examples
from fcsl_compiler.api.files import read_json

from ..errors import BusError, did_you_mean
from ..vars.show import jsonable, show_value, table, with_unit
from ..vars.value_text import read_value
from .feed import Feed
from .machine import BusChannel, BusMachine, read_machine
from .session import Session

_EPILOG = """\
-c is where fcsl-fc or fcsl-sim listens with --observers; `play` listens itself. A channel is its name, or MACHINE/NAME
where several machines have one. Exit status: 0; 1 if `play` was answered otherwise than in its bag; 2 if nothing
listens, the flight computer is another one or gone, or for wrong usage."""


def main(arguments: Sequence[str]) -> int:
    options = make_parser().parse_args(arguments)
    run: Callable[[argparse.Namespace], int | None] = options.run
    return run(options) or 0


_EXAMPLES = {
    "": "list -c tcp:127.0.0.1:7447",
    "list": "-c tcp:127.0.0.1:7447",
    "echo": "-c tcp:127.0.0.1:7447 throttle -n 10",
    "hz": "-c tcp:127.0.0.1:7447 --seconds 5",
    "put": "-c tcp:127.0.0.1:7447 altitude 12.5",
    "record": "-c tcp:127.0.0.1:7447 -o flight",
    "play": "--listen tcp:127.0.0.1:7447 flight --speed 1",
}


def make_parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="fcsl bus", description="Machines on the bus.", epilog=_EPILOG, formatter_class=raw
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, run: Callable[[argparse.Namespace], int | None], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        if name == "play":
            command.add_argument("--listen", required=True, metavar="tcp:HOST:PORT", help="where fcsl-fc connects to")
        else:
            command.add_argument("-c", "--connect", required=True, metavar="tcp:HOST:PORT", help="who listens")
        command.set_defaults(run=run)
        return command

    command = add("list", _list, "lists machines and their channels, with type, unit and measured rate")
    command.add_argument(
        "-s", "--seconds", metavar="SECONDS", type=_seconds, default=1.0, help="how long to measure (default 1)"
    )
    command.add_argument("--json", action="store_true", help="one JSON value, with the descriptors")
    command = add("echo", _echo, "prints values as they come: tick, channel, value; until Ctrl-C")
    command.add_argument("channels", nargs="*", metavar="CHANNEL", help="only these")
    command.add_argument("-n", type=_count, metavar="N", help="end after N values")
    command.add_argument("--json", action="store_true", help="one JSON object a line")
    command = add("hz", _hz, "prints the rate of each channel, every second; until Ctrl-C")
    command.add_argument("--seconds", type=_count, metavar="SECONDS", help="end after so many whole seconds")
    command = add("put", _put, "puts a value under a channel's key")
    command.add_argument("channel", metavar="CHANNEL")
    command.add_argument("value", metavar="VALUE", help="such as 0.5, true, '[0, 0, 9.81]'; of a blob hex digits")
    command.add_argument("--descriptor", type=Path, metavar="FILE", help="`list --json` of a bus that serves it")
    command = add(
        "record",
        _record,
        "records all values, and what replays the run, into a bag, until Ctrl-C or the end of the flight",
    )
    command.add_argument("-o", "--output", required=True, type=Path, metavar="DIR", help="new directory for the bag")
    command = add("play", _play, "plays a bag's sensors to a flight computer in lock-step, and compares its answers")
    command.add_argument("bag", metavar="BAG", help="of `record`, or of fcsl-fc, fcsl-sim or a twin")
    command.add_argument(
        "--speed", type=_speed, default=0.0, metavar="FACTOR", help="1: real time (default: as fast as it goes)"
    )
    command.add_argument("--machine", default="", metavar="NAME", help="the machine, if the bag has several")
    which = command.add_mutually_exclusive_group()
    which.add_argument("--config", default="", metavar="FILE", help="machine JSON, for a bag that a host recorded")
    which.add_argument("--library", default="", metavar="FILE", help="machine library, for the same")
    command.add_argument(
        "--timeout", type=_seconds, default=10.0, metavar="SECONDS", help="seconds for each answer (default 10)"
    )
    add_examples(parser, _EXAMPLES)
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) < 2**32:
        raise argparse.ArgumentTypeError(f"a whole number from 1 on wanted, not {text!r}")
    return int(text)


def _seconds(text: str) -> float:
    return _positive(text, 3600, "seconds")


def _speed(text: str) -> float:
    return _positive(text, 1000, "a speed")


def _positive(text: str, most: float, what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number <= most:
        raise argparse.ArgumentTypeError(f"{what} wanted, above 0 and up to {most:g}, not {text!r}")
    return number


# ---- what comes ------------------------------------------------------------------------------------------------------


def _counted(session: Session, until_s: float) -> Counter[str]:
    """Messages of each key until then."""
    return Counter(message.key for message in session.messages(until_s) if message is not None)


def _find(name: str, machines: Sequence[BusMachine]) -> tuple[BusMachine, BusChannel]:
    """The channel of this name, or MACHINE/NAME. Raises BusError."""
    choices: dict[str, list[tuple[BusMachine, BusChannel]]] = {}
    for machine in machines:
        for channel in machine.channels:
            choices.setdefault(channel.name, []).append((machine, channel))
            choices[f"{machine.prefix}/{channel.name}"] = [(machine, channel)]
    found = choices.get(name, [])
    if len(found) > 1:
        raise BusError(f"several machines have a channel `{name}`: write {found[0][0].prefix}/{name}")
    if not found:
        raise BusError(f"no machine here has a channel `{name}`{did_you_mean(name, choices)}")
    return found[0]


# ---- commands --------------------------------------------------------------------------------------------------------


def _list(options: argparse.Namespace) -> None:
    with Session(options.connect) as session:
        machines = _machines(session)
        session.subscribe(machines)
        counts = _counted(session, time.monotonic() + options.seconds)
    rates = {key: count / options.seconds for key, count in counts.items()}
    if options.json:
        print(json.dumps([_as_json(machine, rates) for machine in machines]))
        return
    for machine in machines:
        print(f"{machine.prefix}: {machine.tick_hz} Hz, sources {machine.source_hash[:12]}")
        rows = [
            (
                c.name,
                c.direction,
                c.type_text,
                c.ros_type,
                c.unit,
                f"{rates.get(f'{machine.prefix}/{c.name}', 0.0):.1f} Hz",
                c.doc,
            )
            for c in machine.channels
        ]
        print("\n".join(f"  {line}" for line in table(rows).splitlines()))


def _as_json(machine: BusMachine, rates: dict[str, float]) -> dict[str, Any]:
    return {
        "prefix": machine.prefix,
        "descriptor": json.loads(machine.text),
        "rates_hz": {c.name: rates.get(f"{machine.prefix}/{c.name}", 0.0) for c in machine.channels},
    }


def _echo(options: argparse.Namespace) -> None:
    with Session(options.connect) as session:
        machines = _machines(session)
        chosen = {(m.prefix, c.name) for m, c in (_find(name, machines) for name in options.channels)}
        feed = Feed(session, machines)
        try:
            for line in islice(_lines(feed, chosen, options.json, len(machines) > 1), options.n):
                print(line)
        except KeyboardInterrupt:
            pass  # the normal end
        _report_lost(feed)


def _lines(feed: Feed, chosen: set[tuple[str, str]], as_json: bool, with_machine: bool) -> Iterator[str]:
    """A line for each value. Those before are shown when nothing more has come yet."""
    for found in feed.ticks():
        if found is None:
            sys.stdout.flush()
            continue
        machine, tick = found
        for channel, data in tick.values:
            if chosen and (machine.prefix, channel.name) not in chosen:
                continue
            value = channel.decode(data)
            if as_json:
                entry = {
                    "tick": tick.tick,
                    "machine": machine.prefix,
                    "channel": channel.name,
                    "value": jsonable(value),
                }
                yield json.dumps(entry)
            else:
                name = f"{machine.prefix}/{channel.name}" if with_machine else channel.name
                yield f"{tick.tick}  {name}  {with_unit(show_value(value), channel.unit)}"


def _hz(options: argparse.Namespace) -> None:
    with Session(options.connect) as session:
        machines = _machines(session)
        session.subscribe(machines)
        keys = [f"{machine.prefix}/{channel.name}" for machine in machines for channel in machine.channels]
        begun = time.monotonic()
        try:
            for second in islice(count(1), options.seconds):
                counts = _counted(session, begun + second)
                if time.monotonic() < begun + second:
                    break  # who listens is gone
                print(f"{second} s  {', '.join(f'{key} {counts[key]} Hz' for key in keys)}", flush=True)
        except KeyboardInterrupt:
            pass


def _put(options: argparse.Namespace) -> None:
    with Session(options.connect) as session:
        machines = _machines(session) if options.descriptor is None else _read_descriptors(options.descriptor)
        machine, channel = _find(options.channel, machines)
        text = options.value
        data = channel.encode(text if channel.is_blob else read_value(text))
        session.put(f"{machine.prefix}/{channel.name}", data)


def _machines(session: Session) -> list[BusMachine]:
    """All that can be read; of others a line says why not."""
    machines, refused = session.machines()
    for why in refused:
        print(f"fcsl bus: left out: {why}", file=sys.stderr)
    return machines


def _read_descriptors(path: Path) -> list[BusMachine]:
    try:
        entry = read_json(path)
        return [read_machine(str(machine["prefix"]), json.dumps(machine["descriptor"])) for machine in entry]
    except (ValueError, LookupError, TypeError):
        raise BusError(f"{path}: not what `fcsl bus list --json` prints") from None


def _record(options: argparse.Namespace) -> None:
    from .record import recording  # here, because its imports take as long as all others

    with Session(options.connect) as session:
        machines = _machines(session)
        with recording(options.output, machines, session, partial(print, flush=True)) as bag:
            feed = Feed(session, machines, writes=True)
            for number in (signal.SIGINT, signal.SIGTERM):  # an exception could leave half a message in the bag
                signal.signal(number, lambda *_: session.stop())
            print(f"recording {', '.join(m.prefix for m in machines)} to {options.output}", flush=True)
            for found in feed.events():
                bag.take(found)
        print(f"{options.output}: {bag.messages} messages")
        for prefix, verdict in bag.verdicts.items():
            print(f"{prefix}: {verdict}")
        _report_lost(feed)


def _play(options: argparse.Namespace) -> int:
    from ..bag.formats import open_bag  # here, because these imports take as long as all others
    from ..replay.replaying import open_machine
    from .bag_ticks import read_bag_ticks
    from .controller import Controller
    from .play import Player

    bag = open_bag(options.bag)
    with ExitStack() as opened:
        run = open_machine(options.config, options.library, None) if options.config or options.library else None
        if run is not None:
            opened.callback(run.close)
        ticks = read_bag_ticks(bag, run, options.machine)
        ticks.check()
        session = opened.enter_context(Session(options.listen, listens=True))
        stop = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):  # an exception could leave half a tick on the bus
            signal.signal(number, lambda *_: stop.set())
        controller = Controller(session, ticks.machine, options.timeout)
        print(f"{ticks.machine.prefix}: waiting for a flight computer on {options.listen}", flush=True)
        if not controller.meet(stop.is_set):
            return 0
        opened.callback(controller.end)
        print(f"{ticks.machine.prefix}: playing", flush=True)
        played = Player(ticks, controller, options.speed, stop.is_set).play()
    print(played)
    if ticks.left_out:
        done = ", ".join(f"{count} {kind}" for kind, count in sorted(ticks.left_out.items()))
        print(f"fcsl bus: the host did more than sample, which is not played: {done}", file=sys.stderr)
    return 1 if played.differ else 0


def _report_lost(feed: Feed) -> None:
    if lost := feed.lost():
        print(f"fcsl bus: {lost}", file=sys.stderr)
