# SPDX-License-Identifier: Apache-2.0
"""fcsl hal: brings up the sensors and actuators of a vehicle (docs/hardware/hal.md)."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence

from fcsl_compiler.api.command_line import add_examples

from ..errors import TwinError
from .errors import Refused

EXIT_REFUSED = 1
_EPILOG = """\
DRIVER is one that comes with FCSL, or LIBRARY.so:NAME (docs/hardware/hal.md). Exit status: 0; 1 if something is not as it
should be: a device is missing, a calibration or a movement is refused; 2 for wrong usage or an unreadable file."""
_MEASURED = {
    "gyro": "the offset of a gyro, from a vehicle that stands still",
    "accel": "offset and scale of an accelerometer, from a vehicle on each of its six sides",
    "compass": "hard and soft iron of a compass, from a vehicle that is turned about all its axes",
    "rc": "the ranges of a remote control, from sticks that are moved to all their ends",
}
_ESC = """\
PROPELLERS OFF. It sends the longest pulse, asks for the controllers' power, sends the shortest pulse after Enter, and the
safe value last, whatever ends it. No file is changed."""


def main(arguments: Sequence[str]) -> int:
    options = make_parser().parse_args(arguments)
    run: Callable[[argparse.Namespace], None] = options.run
    try:
        run(options)
    except Refused as error:
        sys.stdout.flush()
        print(f"fcsl hal: {error}", file=sys.stderr)
        return EXIT_REFUSED
    return 0


_EXAMPLES = {
    "": "list",
    "list": "--json",
    "describe": "craft.plan --seconds 5",
    "monitor": "craft.plan --seconds 10",
    "calibrate": "gyro craft.board.json --sensor gyro",
    "calibrate gyro": "craft.board.json --sensor gyro --seconds 10",
    "calibrate accel": "craft.board.json --sensor accel",
    "calibrate compass": "craft.board.json --sensor compass",
    "calibrate rc": "craft.board.json --sensor rc",
    "calibrate esc": "craft.plan --channels motors --yes-move-it",
    "test-actuator": "craft.plan motors[0] --command 0.1 --seconds 2 --yes-move-it",
}


def make_parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="fcsl hal", description="The sensors and actuators of this computer.", epilog=_EPILOG, formatter_class=raw
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, run: Callable[[argparse.Namespace], None], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    command = add("list", _list, "lists devices and the drivers for them; opens and changes nothing")
    command.add_argument("--json", action="store_true", help="one JSON value")
    command = add("describe", _describe, "describes a driver's signals, a device's values, or a board's plan")
    command.add_argument("what", metavar="DRIVER|PLAN", help="a driver, or the file that `fcsl board` wrote")
    command.add_argument("device", nargs="?", metavar="DEVICE", help='the text of "device" in board.json')
    command.add_argument(
        "--seconds", type=_seconds(60), default=2.0, metavar="SECONDS", help="wait for a sample (default 2)"
    )
    shape = command.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="one JSON value")
    shape.add_argument("--plot", metavar="FILE", help="draw the filters of a PLAN: .png, .svg or .pdf")
    command = add("monitor", _monitor, "shows devices and sensors of a plan as they run; until Ctrl-C")
    command.add_argument("plan", metavar="PLAN", help="the file that `fcsl board` wrote")
    command.add_argument("--sensor", metavar="NAME", help="only this one")
    command.add_argument("--seconds", type=_seconds(1e6), metavar="SECONDS", help="end after N s")
    shape = command.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="one JSON object a line")
    shape.add_argument("--plot", action="store_true", help="curves of the corrected values")
    _add_calibrate(
        add("calibrate", _calibrate, "measures what corrects a sensor, or teaches motor controllers their range")
    )
    command = add(
        "test-actuator", _test_actuator, "moves one element of an output for some seconds, then makes it safe"
    )
    command.add_argument("plan", metavar="PLAN", help="the file that `fcsl board` wrote")
    command.add_argument("element", metavar="CHANNEL[INDEX]", help="such as motors[0]; without [INDEX]: [0]")
    value = command.add_mutually_exclusive_group(required=True)
    value.add_argument("--command", type=_number, metavar="X", help="of the machine, between `low` and `high`")
    value.add_argument("--pulse", type=_number, metavar="US", help="of the device, between `minimum` and `maximum`")
    command.add_argument("--seconds", type=_seconds(10), required=True, metavar="SECONDS", help="at most 10")
    command.add_argument("--yes-move-it", action="store_true", help="nothing moves without it")
    add_examples(parser, _EXAMPLES)
    return parser


def _add_calibrate(command: argparse.ArgumentParser) -> None:
    kinds = command.add_subparsers(metavar="WHAT", required=True)
    for what, text in _MEASURED.items():
        kind = kinds.add_parser(what, help=text, description=f"{text}; for the board's JSON")
        kind.set_defaults(what=what)
        kind.add_argument("board", metavar="BOARD", help="board JSON")
        kind.add_argument("--sensor", required=True, metavar="NAME", help="the one that is calibrated")
        kind.add_argument("--device", metavar="NAME", help="of the sensor's; needed if it has several")
        kind.add_argument("--seconds", type=_seconds(3600), metavar="SECONDS", help="how long it measures")
        kind.add_argument("--write", action="store_true", help="write the values into BOARD")
    text = "electronic speed controllers of motors: they learn the ends of their outputs"
    esc = kinds.add_parser("esc", help=text, description=f"{text}. {_ESC}")
    esc.set_defaults(run=_calibrate_esc)
    esc.add_argument("plan", metavar="PLAN", help="the file that `fcsl board` wrote")
    esc.add_argument(
        "--channels",
        dest="names",
        nargs="+",
        required=True,
        metavar="CHANNEL[INDEX]",
        help="of one device, such as motors[0] motors[1]; motors: all its elements",
    )
    esc.add_argument("--yes-move-it", action="store_true", help="nothing moves without it")


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"a number wanted, not {text!r}")
    return number


def _seconds(most: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        number = _number(text)
        if not 0 < number <= most:
            raise argparse.ArgumentTypeError(f"seconds wanted, above 0 and up to {most:g}, not {text!r}")
        return number

    return read


# ---- commands: what they import is loaded when it is needed -------------------------------------------------------------


def _list(options: argparse.Namespace) -> None:
    from .listing import list_devices

    list_devices(options.json)


def _describe(options: argparse.Namespace) -> None:
    from .describe import describe_driver
    from .describe_plan import describe_plan, is_plan

    if is_plan(options.what):
        if options.device is not None:
            raise TwinError(f"{options.what} is a plan: it has its devices itself")
        if options.plot is not None:
            from .plot_filters import plot_filters

            plot_filters(options.what, options.plot)
        else:
            describe_plan(options.what, options.json)
    elif options.plot is not None:
        raise TwinError(f"{options.what} is no plan: --plot draws the filters of a plan")
    else:
        describe_driver(options.what, options.device, options.seconds, options.json)


def _monitor(options: argparse.Namespace) -> None:
    from .monitor import monitor

    monitor(options.plan, options.sensor, options.seconds, options.json, options.plot)


def _calibrate(options: argparse.Namespace) -> None:
    from .calibrate import calibrate

    calibrate(options.what, options.board, options.sensor, options.device, options.seconds, options.write)


def _calibrate_esc(options: argparse.Namespace) -> None:
    from .calibrate_esc import calibrate_esc

    calibrate_esc(options.plan, options.names, options.yes_move_it)


def _test_actuator(options: argparse.Namespace) -> None:
    from .actuator import test_actuator

    test_actuator(options.plan, options.element, options.command, options.pulse, options.seconds, options.yes_move_it)
