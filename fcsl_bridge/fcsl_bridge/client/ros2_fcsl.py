# SPDX-License-Identifier: Apache-2.0
"""`ros2 fcsl`: running machines from the command line. The command and its verbs are entry points in setup.py.

Only the command needs ros2cli; it is imported when `ros2` runs it. running_machines.py does the work. An error is one line on
standard error and status 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import Any

from ..errors import BridgeError

_FIND_S = 2.0
_ANSWER_S = 5.0


class FcslCommand:
    """Machines of FCSL that run on the graph"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        from ros2cli.command import add_subparsers_on_demand

        self._parser = parser
        add_subparsers_on_demand(parser, cli_name, "_verb", "ros2fcsl.verb", required=False)

    def main(self, *, parser: argparse.ArgumentParser, args: argparse.Namespace) -> int | str:
        verb = getattr(args, "_verb", None)
        if verb is None:
            self._parser.print_help()
            return 0
        return verb.main(args=args)


class Verb:
    """The extension point of `ros2 fcsl`'s verbs: arguments, and `run`, which raises BridgeError."""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        """One that takes no arguments of its own adds none."""

    def run(self, args: argparse.Namespace) -> int:
        raise NotImplementedError

    def main(self, *, args: argparse.Namespace) -> int | str:
        """The exit status, or the error, which `ros2` prints."""
        try:
            return self.run(args)
        except BridgeError as error:
            return f"ros2 fcsl: error: {error}"


def _of_a_machine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("machine", help="its name, or namespace and name: lander_control, /one/lander_control")
    _timeout(parser, _ANSWER_S, "how long to look for it, and to wait for an answer")


def _timeout(parser: argparse.ArgumentParser, default: float, what: str) -> None:
    parser.add_argument(
        "-t", "--timeout", type=_seconds, default=default, metavar="SECONDS", help=f"{what} ({default:g})"
    )


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < 1e6:
        raise argparse.ArgumentTypeError(f"`{text}` is no number of seconds above zero")
    return seconds


class ListVerb(Verb):
    """List the machines that run: namespace and name, state, node"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        _timeout(parser, _FIND_S, "how long to look for machines")

    def run(self, args: argparse.Namespace) -> int:
        from .running_machines import graph

        with graph() as opened:
            states = opened.states(args.timeout)
        _print((machine.path, state or "-", machine.node) for machine, state in states.items())
        return 0


class InfoVerb(Verb):
    """Print what a machine is: hashes, rate, states, channels, topics"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        _of_a_machine(parser)

    def run(self, args: argparse.Namespace) -> int:
        from .running_machines import graph

        with graph() as opened:
            machine = opened.find(args.machine, args.timeout)
            what = opened.describe(machine, args.timeout)
            topics = opened.topics(machine.node)
        print(f"{machine.path}, in node {machine.node}")
        rows = [(f"  {name}", str(getattr(what, name))) for name in ("tick_hz", "library")]
        rows += [(f"  {name}", getattr(what, name)) for name in ("source_hash", "layout_hash", "build_hash")]
        _print([*rows, ("  states", ", ".join(what.states))])
        print("channels")
        _print(_channel(channel) for channel in what.channels)
        print("topics")
        _print((f"  {topic}", ", ".join(kinds)) for topic, kinds in topics if topic.startswith(f"{machine.path}/"))
        return 0


def _channel(channel: Any) -> Sequence[str]:
    """A row of the table."""
    mapped = f"{channel.topic} ({', '.join(filter(None, (channel.message, channel.field)))})" if channel.topic else ""
    return f"  {channel.name}", channel.direction, str(channel.id), channel.type, channel.unit, mapped


class StateVerb(Verb):
    """Print the state that a machine is in"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        _of_a_machine(parser)
        follow = "print tick and state at each change, and when the controller gives no sign of life; ends with Ctrl-C"
        parser.add_argument("-f", "--follow", action="store_true", help=follow)

    def run(self, args: argparse.Namespace) -> int:
        from .running_machines import graph

        with graph() as opened:
            machine = opened.find(args.machine, args.timeout)
            if not args.follow:
                print(opened.state(machine, args.timeout).state)
                return 0
            watch = opened.watch(machine, lambda: print(f"{machine.path}: no sign of life", flush=True))
            shown = ""
            while True:
                opened.until(lambda: bool(watch.states), args.timeout)
                for message in watch.states:
                    if message.state != shown:
                        shown = message.state
                        print(f"{message.tick}  {shown}", flush=True)
                watch.states.clear()


class SetStateVerb(Verb):
    """Force a state; the node needs allow_set_state"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        _of_a_machine(parser)
        parser.add_argument("state", help="one of the machine's states")

    def run(self, args: argparse.Namespace) -> int:
        from .running_machines import graph

        with graph() as opened:
            opened.set_state(opened.find(args.machine, args.timeout), args.state, args.timeout)
        return 0


class ReplayVerb(Verb):
    """Replay a bag, bit for bit; the same as fcsl replay"""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        from simclient.replay.command import add_arguments

        self._parser = parser
        add_arguments(parser)

    def run(self, args: argparse.Namespace) -> int:
        from simclient.cli import guarded
        from simclient.replay.command import command

        return guarded("ros2 fcsl replay", lambda: command(self._parser, args))


def _print(rows: Iterable[Sequence[str]]) -> None:
    """Prints a table with columns as wide as needed."""
    table = [list(row) for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    for row in table:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
