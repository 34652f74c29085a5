# SPDX-License-Identifier: Apache-2.0
"""fcsl-hal: brings up the sensors and actuators of a vehicle (docs/hal_tools.md)."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence

from fcsl_compiler.base.version import add_version

from ..errors import TwinError
from .errors import Refused

EXIT_REFUSED = 1
_EPILOG = """\
DRIVER is one that comes with FCSL, or LIBRARY.so:NAME (docs/drivers.md). Exit status: 0; 1 if something is not as it
should be: a device is missing, a calibration or a movement is refused; 2 for wrong usage or an unreadable file."""


def main(arguments: Sequence[str]) -> int:
    options = _parser().parse_args(arguments)
    run: Callable[[argparse.Namespace], None] = options.run
    try:
        run(options)
    except Refused as error:
        sys.stdout.flush()
        print(f"fcsl-hal: {error}", file=sys.stderr)
        return EXIT_REFUSED
    return 0


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="fcsl-hal", description="The sensors and actuators of this computer.", epilog=_EPILOG, formatter_class=raw
    )
    add_version(parser, "simclient", __file__)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, run: Callable[[argparse.Namespace], None], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    command = add("list", _list, "lists devices and the drivers for them; opens and changes nothing")
    command.add_argument("--json", action="store_true", help="one JSON value")
    command = add("describe", _describe, "describes a driver's signals, a device's values, or a board's plan")
    command.add_argument("what", metavar="DRIVER|PLAN", help="a driver, or the file that `fcslc board` wrote")
    command.add_argument("device", nargs="?", metavar="DEVICE", help='the text of "device" in board.json')
    command.add_argument("--seconds", type=_seconds(60), default=2.0, metavar="N", help="wait for a sample (default 2)")
    shape = command.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="one JSON value")
    shape.add_argument("--plot", metavar="FILE", help="draw the filters of a PLAN: .png, .svg or .pdf")
    command = add("monitor", _monitor, "shows devices and sensors of a plan as they run; until Ctrl-C")
    command.add_argument("plan", metavar="PLAN", help="the file that `fcslc board` wrote")
    command.add_argument("--sensor", metavar="NAME", help="only this one")
    command.add_argument("--seconds", type=_seconds(1e6), metavar="N", help="end after N s")
    shape = command.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="one JSON object a line")
    shape.add_argument("--plot", action="store_true", help="curves of the corrected values")
    _add_calibrate(add("calibrate", _calibrate, "measures what corrects a sensor, for the board's JSON"))
    command = add(
        "test-actuator", _test_actuator, "moves one element of an output for some seconds, then makes it safe"
    )
    command.add_argument("plan", metavar="PLAN", help="the file that `fcslc board` wrote")
    command.add_argument("element", metavar="CHANNEL[INDEX]", help="such as motors[0]; without [INDEX]: [0]")
    value = command.add_mutually_exclusive_group(required=True)
    value.add_argument("--command", type=_number, metavar="X", help="of the machine, between `low` and `high`")
    value.add_argument("--pulse", type=_number, metavar="US", help="of the device, between `minimum` and `maximum`")
    command.add_argument("--seconds", type=_seconds(10), required=True, metavar="N", help="at most 10")
    command.add_argument("--yes-move-it", action="store_true", help="nothing moves without it")
    return parser


def _add_calibrate(command: argparse.ArgumentParser) -> None:
    command.add_argument("what", choices=("gyro", "accel", "compass", "rc"))
    command.add_argument("board", metavar="BOARD", help="board JSON")
    command.add_argument("--sensor", required=True, metavar="NAME")
    command.add_argument("--device", metavar="NAME", help="of the sensor's; needed if it has several")
    command.add_argument("--seconds", type=_seconds(3600), metavar="N", help="how long it measures")
    command.add_argument("--write", action="store_true", help="write the values into BOARD")


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


def _test_actuator(options: argparse.Namespace) -> None:
    from .actuator import test_actuator

    test_actuator(options.plan, options.element, options.command, options.pulse, options.seconds, options.yes_move_it)
