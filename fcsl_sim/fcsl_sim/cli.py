# SPDX-License-Identifier: Apache-2.0
"""`fcsl-sim`: checks and runs simulations."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from collections.abc import Sequence
from fractions import Fraction
from math import isfinite, isnan
from pathlib import Path
from types import FrameType

from fcsl_compiler.base.codes.pages import UnknownCode, pages
from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.version import add_version

from .codes import SIM_CODES
from .config import SERIAL_LINK, SimConfig, load
from .errors import SimError
from .models import Scalar
from .output import show
from .runner import FREE_RUNNING, TIMEOUT_MS, Sender, Server, StateChange, Summary, Watcher, run

EXIT_UNTIL_NOT_HELD = 1
EXIT_BAD_INPUT = 2
#: How an address on the bus begins.
_BUS = ("zenoh:", "zenoh-client:")


class _Terminated(KeyboardInterrupt):
    """SIGTERM arrived. It ends a run as SIGINT does, so that the bag is closed and the socket removed."""


def _terminate(number: int, frame: FrameType | None) -> None:
    raise _Terminated


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 if the run completed, 1 if `until` has not held in it, 2 for wrong input, 130 on SIGINT, 143 on
    SIGTERM; the bag is then complete with the ticks done so far.
    """
    options = _parser().parse_args(arguments)
    try:
        signal.signal(signal.SIGTERM, _terminate)
        status = {"check": _check, "run": _run, "explain": _explain}[options.command](options)
        sys.stdout.flush()
        return status
    except DiagnosticError as error:
        print(error, file=sys.stderr)
        count = len(error.diagnostics)
        print(f"fcsl-sim: {count} error{'s' if count > 1 else ''}", file=sys.stderr)
    except SimError as error:
        print(f"fcsl-sim: error: {error}", file=sys.stderr)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"fcsl-sim: error: {place}{error.strerror}", file=sys.stderr)
    except _Terminated:
        return _interrupted(options, signal.SIGTERM)
    except KeyboardInterrupt:
        return _interrupted(options, signal.SIGINT)
    return EXIT_BAD_INPUT


def _interrupted(options: argparse.Namespace, number: signal.Signals) -> int:
    bag = getattr(options, "record", None)
    kept = f"; {bag} has the ticks flown until then" if bag and Path(bag).exists() else ""
    print(f"fcsl-sim: interrupted{kept}", file=sys.stderr)
    return 128 + number


def _seed(text: str) -> int:
    value = int(text, 10)
    if not 0 <= value < 2**64:
        raise ValueError
    return value


def _seconds(text: str) -> Fraction:
    about = float(text)
    if isnan(about):
        raise ValueError
    if not 0 < about <= 1e9:
        raise argparse.ArgumentTypeError(f"{text} s is {'not above zero' if about <= 0 else 'more than 1e+09 s'}")
    return Fraction(text)  # exact; without the checks above, 1e99999999 would take minutes


def _speed(text: str) -> float:
    value = float(text)
    if not (isfinite(value) and value >= 0):
        raise ValueError
    return value


# argparse uses these names in its error messages.
_seed.__name__ = "seed (0 to 2^64 - 1)"
_seconds.__name__ = "number of seconds"
_speed.__name__ = "speed (a number above zero, or 0 for as fast as possible)"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcsl-sim", description="Flies a compiled machine against plant models.")
    add_version(parser, "fcsl_sim", __file__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in (("check", "check a simulation, run nothing"), ("run", "run a simulation to its end")):
        command = commands.add_parser(name, help=text, description=text.capitalize() + ".")
        command.add_argument("config", help="*.sim.json, or package://PACKAGE/PATH below its share folder")
        command.add_argument("--seed", type=_seed, help="random seed; replaces the file's")
        command.add_argument(
            "--duration", type=_seconds, metavar="S", help="longest simulated time in s; replaces the file's"
        )
        help_set = "sets a model parameter: altimeter.parameters.sigma=0.8 (repeatable)"
        command.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", dest="sets", help=help_set)
    command.add_argument("--record", type=Path, metavar="BAG", help="new directory for the bag")
    command.add_argument(
        "--namespace", default="", help="ROS namespace of the bag's topics, and of the keys on the bus"
    )
    command.add_argument(
        "--external",
        metavar="PEER",
        help="the controller is another process (fcsl-fc --hal PEER): at the other end of a wire, with wire:unix:PATH, "
        "wire:udp:HOST:PORT, wire:tcp:HOST:PORT, wire:uart:DEVICE:BAUD or wire:zenoh:tcp/HOST:PORT; or on the bus, each "
        "channel under its key, with zenoh:tcp/HOST:PORT, or zenoh-client: where another simulation listens; with "
        ",free-running behind that, neither waits for the other",
    )
    help_speed = "limit on simulated seconds per second: 1 for real time; 0 (default): as fast as possible"
    command.add_argument("--speed", type=_speed, default=0.0, metavar="FACTOR", help=help_speed)
    help_socket = "serve all variables (docs/protocol.md) on this Unix socket, or on tcp:HOST:PORT with --token"
    command.add_argument("--socket", metavar="ADDRESS", help=help_socket)
    help_checkpoints = "folder of the checkpoint files that clients name"
    command.add_argument("--checkpoints", type=Path, metavar="DIR", help=help_checkpoints)
    command.add_argument("--token", type=Path, metavar="FILE", help="token file of a TCP server; created if absent")
    command.add_argument("--paused", action="store_true", help="start paused: only commands run ticks until `resume`")
    help_telemetry = "send values as UDP (docs/telemetry.md) to udp:HOST:PORT, or of every N-th tick to udp:HOST:PORT/N"
    command.add_argument("--telemetry", metavar="ADDRESS", help=help_telemetry)
    help_fields = (
        "fields to send, as path globs separated by commas (default: inputs, outputs, state, health, counters)"
    )
    command.add_argument("--telemetry-fields", metavar="GLOBS", help=help_fields)
    help_observers = "put the values of all channels on a bus of their own (docs/bus.md), which listens there"
    command.add_argument("--observers", metavar="tcp/HOST:PORT", help=help_observers)
    help_ros = (
        "publish the machine's ROS 2 topics and /clock through a bridge (docs/ros_graph.md), for which it listens there"
    )
    command.add_argument("--ros", metavar="tcp/HOST:PORT", help=help_ros)
    help_timeout = f"seconds to wait for the external controller (default {TIMEOUT_MS // 1000})"
    command.add_argument("--timeout", type=_seconds, metavar="S", help=help_timeout)
    command.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")
    why = commands.add_parser("explain", help="explain a diagnostic code of simulations, with an example")
    why.add_argument("code", nargs="*", help="such as E804; none: list all")
    return parser


def _explain(options: argparse.Namespace) -> int:
    try:
        print(pages(options.code, SIM_CODES, "fcslc explain"), end="")
    except UnknownCode as error:
        raise SimError(str(error)) from None
    return 0


def _load(options: argparse.Namespace) -> SimConfig:
    config = load(options.config, seed=options.seed, duration_s=options.duration, sets=options.sets)
    for warning in config.warnings:
        print(warning, file=sys.stderr)
    return config


def _check(options: argparse.Namespace) -> int:
    config = _load(options)
    seconds = config.machine.time_ns(config.ticks) / 1e9
    print(f"{options.config}: ok: `{config.machine.name}` and {', '.join(config.tables)} for at most {seconds:g} s")
    return 0


def _run(options: argparse.Namespace) -> int:
    external: str | None = options.external
    if external is not None and not external.startswith(("wire:", *_BUS)):
        raise SimError(
            f"--external {external}: write wire:SPEC, as in wire:unix:PATH or wire:udp:127.0.0.1:7600, "
            "or zenoh:tcp/HOST:PORT"
        )
    if options.socket is None and (options.paused or options.token or options.checkpoints):
        raise SimError("`--paused`, `--token` and `--checkpoints` need `--socket`: they configure the variable server")
    if options.telemetry_fields is not None and options.telemetry is None:
        raise SimError("`--telemetry-fields` needs `--telemetry`: it selects the values to send")
    on_bus = options.observers is not None or options.ros is not None or (external or "").startswith(_BUS)
    if options.namespace and options.record is None and not on_bus:
        raise SimError(
            "`--namespace` needs `--record`, `--observers`, `--ros` or `--external zenoh:…`: it is of topics, and of keys "
            "of the bus"
        )
    if options.timeout is not None and external is None:
        raise SimError("`--timeout` needs `--external`: it limits the wait for the controller")
    if options.timeout is not None and external is not None and external.endswith(FREE_RUNNING):
        raise SimError("`--timeout` does not go with `,free-running`: nobody waits for the controller")
    server = None
    if options.socket is not None:
        server = Server(options.socket, options.token, options.checkpoints, options.paused)
    config = _load(options)
    summary = run(
        config,
        bag=options.record,
        name_space=options.namespace,
        external=external,
        timeout_ms=TIMEOUT_MS if options.timeout is None else min(2**31 - 1, max(1, int(options.timeout * 1000))),
        speed=options.speed,
        server=server,
        sender=None if options.telemetry is None else Sender(options.telemetry, options.telemetry_fields),
        observers=options.observers,
        ros=options.ros,
        watcher=None if options.json else _Printer(config, external),
    )
    if options.json:
        show(json.dumps(summary.as_json(), indent=2))
    else:
        _print_summary(config, summary)
    return EXIT_UNTIL_NOT_HELD if summary.until_held is False else 0


class _Printer(Watcher):
    """Tells people."""

    def __init__(self, config: SimConfig, external: str | None):
        self._config, self._external = config, external

    def listening(self) -> None:
        serial = str(self._external).startswith("wire:uart:")
        end = "wire:uart:DEVICE:BAUD with the device at the other end of the line" if serial else self._external
        waits = "a controller may come" if str(self._external).endswith(FREE_RUNNING) else "waiting for a controller"
        show(f"{waits}: fcsl-fc {self._config.library} --hal {end}")

    def serving(self, address: str) -> None:
        show(f"variables on {address}")

    def changed(self, change: StateChange) -> None:
        show(f"{change.time_s:10.3f} s  {change.from_state} -> {change.to_state}")


def _value_text(value: Scalar | list[Scalar]) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_value_text(v) for v in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _factor_text(factor: float) -> str:
    return f"{factor:.0f}" if factor >= 100 else f"{factor:.3g}"


def _print_summary(config: SimConfig, summary: Summary) -> None:
    why = "the stop condition held" if summary.end == "until" else "the duration is over"
    show(f"{summary.time_s:10.3f} s  end: {why}")
    for name, table in config.tables.items():
        if table.integrated or table.name == SERIAL_LINK:
            for field in table.of_role("output"):
                value = _value_text(summary.truth[f"{name}.{field.path}"])
                show(f"  {name}.{field.path} = {value}{' ' + field.unit if field.unit else ''}")
    show(
        f"seed {summary.seed}: {summary.ticks} ticks in {summary.wall_s:.3f} s, "
        f"{_factor_text(summary.real_time_factor)} times real time"
    )
    if summary.telemetry:
        counts = summary.telemetry
        show(
            f"telemetry: {counts['packets']} packets, {counts['overwritten']} overwritten, {counts['configurations']} configurations, "
            f"{counts['datagrams']} datagrams sent, {counts['failures']} were returned or not accepted"
        )
    if summary.commands:
        counts = summary.commands
        show(
            f"commands: in {counts['commands']} ticks; none in {counts['ticks_without']}, at most "
            f"{counts['longest_without']} in a row"
        )
    if summary.observers:
        show(f"observers: {summary.observers['ticks']} ticks, {summary.observers['dropped']} dropped")
    if summary.ros:
        show(
            f"ROS 2 topics: {summary.ros['ticks']} ticks, {summary.ros['dropped']} dropped, {summary.ros['refused']} messages refused"
        )
    if summary.bag:
        show(f"bag: {summary.bag}")
    if summary.until_held is False:
        show(f"until never held: {config.until}")
