# SPDX-License-Identifier: Apache-2.0
"""The command line of fcslc. It imports no command, so that help and errors of usage come at once."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..base.version import add_version
from ..model.choices import BACKENDS, DEFAULT_BACKEND, DEFAULT_TARGET

#: Forms of a report (report.py), results that a build prints (driver/passes.py), and how the plan of a board ends.
FORMATS = ("text", "json", "sarif")
DUMPS = ("parse", "check", "schedule", "verify", "lower", "emit", "types")
PLAN_SUFFIX = ".plan"

_TARGET_HELP = f"which of the machine's `targets` its externs are linked from (default: {DEFAULT_TARGET})"
_STRICT_HELP = "every input without connection or channel must be listed in the `inputs` of its instance"
_COVER_EPILOG = """\
example: fcslc cover lander_control.json --fail-under mcdc=100 -- python3 -m pytest test

Every machine that COMMAND compiles (AlgTwin.from_config, fcsl-sim) is built with coverage probes. Such a build must not
fly, and other hosts reject it. PyTwin and existing libraries are not measured. The same without fcslc:
python3 -m pytest --fcsl-cover.

lines     lines on which a statement begins
branches  both outcomes of every decision (a Boolean expression that is the condition of an `if` or a conditional
          expression, or whose value is used), and for each loop that may run no iteration: one iteration, and none
MC/DC     conditions that decided their decision's outcome independently, both as True and as False (masking MC/DC as in
          DO-178C and CAST-10); a chain a < b < c consists of the conditions a < b and b < c
"""


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options; `subcommand` names the module of the command. Wrong ones end the program with status 2."""
    own, command = _split_command(arguments)
    return _parser().parse_args(own, argparse.Namespace(command=command))


def _split_command(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Splits the arguments of `fcslc cover` at the first `--`: its own arguments, and the command. For other
    subcommands the second part is empty.

    If `--` is missing, options may belong to the command. They are dropped, so that cover can report the missing
    `--`.
    """
    words = list(arguments)
    if words[:1] != ["cover"]:
        return words, []
    if "--" in words:
        at = words.index("--")
        return words[:at], words[at + 1 :]
    if "-h" in words or "--help" in words:
        return words, []
    return [word for word in words if not word.startswith("-")], []


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcslc", description="Compiles machines (JSON and algorithms) to native C.")
    add_version(parser, "fcsl_compiler", __file__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="subcommand")

    check = commands.add_parser("check", help="report errors; write nothing")
    check.add_argument("config", type=Path, nargs="+", help="machine JSON")
    check.add_argument("--strict", action="store_true", help=_STRICT_HELP)
    _add_format(check)

    _add_build(commands)
    _add_board(commands)

    why = commands.add_parser("explain", help="explain a diagnostic code, with an example, or a function")
    why.add_argument("what", nargs="*", help="a code such as E402, or a function such as kf_gain; none: list all codes")

    scan = commands.add_parser("scan", help="check that machine libraries call only functions allowed in a step")
    scan.add_argument("library", type=Path, nargs="+", help="shared library of machines")
    scan.add_argument("--objects", type=Path, help="folder of the machines' object files; also print stack bounds")
    scan.add_argument("--emitted", type=Path, help="folder of the generated C; allows calls of the declared externs")

    externs = commands.add_parser("externs", help="print the link inputs of a target, for build systems")
    externs.add_argument("config", type=Path, nargs="+", help="machine JSON")
    externs.add_argument("--target", default=DEFAULT_TARGET, help=_TARGET_HELP)

    messages = commands.add_parser("messages", help="write the ROS 2 .msg files of the instances and their structs")
    messages.add_argument("config", type=Path, nargs="+", help="machine JSON")
    messages.add_argument("-o", "--output", type=Path, required=True, help="folder for the .msg files")
    messages.add_argument("--package", help="the ROS 2 package that builds them; it must contain the machines")
    messages.add_argument(
        "--sources", type=Path, help="write the list of input files here, one per line, for build systems"
    )
    _add_authoring(commands)
    _add_cover(commands)
    return parser


def _add_build(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    build = commands.add_parser("build", help="compile to a shared library, or to C only")
    build.add_argument("config", type=Path, nargs="+", help="machine JSON; several go into one library")
    build.add_argument("-o", "--output", type=Path, help="output folder (default: build beside the first config)")
    build.add_argument("--name", help="library name (default: the first machine's)")
    build.add_argument("--c-only", action="store_true", help="write C (and Nim), header and map, do not compile them")
    build.add_argument("--depfile", type=Path, help="write the dependencies of the C files, for make and ninja")
    build.add_argument("--backend", choices=BACKENDS, default=DEFAULT_BACKEND, help="language of the generated source")
    build.add_argument("--target", default=DEFAULT_TARGET, help=_TARGET_HELP)
    build.add_argument(
        "--instances", metavar="NAME,…", help="build a subset machine with only these instances (one config)"
    )
    build.add_argument("--strict", action="store_true", help=_STRICT_HELP)
    build.add_argument("--dump", choices=DUMPS, help="print the result of a pass, or the types of locals, and stop")
    what = "print a resource report: order, latencies, operations, instructions, stack, sizes, load; FILE: also as JSON"
    build.add_argument("--report", nargs="?", const="", metavar="FILE.json", help=what)
    _add_format(build)


def _add_board(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    board = commands.add_parser("board", help="check a board against its machine, write its plan")
    board.add_argument("config", type=Path, help="board JSON")
    board.add_argument("-o", "--output", type=Path, help=f"the plan (default: beside the board, suffix {PLAN_SUFFIX})")
    _add_format(board)


def _add_authoring(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the commands to fcslc's parser."""
    graph = commands.add_parser("graph", help="draw dataflow and state machine")
    graph.add_argument("config", type=Path, help="machine JSON")
    graph.add_argument("--state", help="show one state (default: all)")
    graph.add_argument("-o", "--output", type=Path, help=".svg, .mmd (Mermaid) or .md; default: Mermaid on stdout")

    schema = commands.add_parser("schema", help="print the JSON Schema of a machine or a board, for editors")
    schema.add_argument("--board", action="store_true", help="that of a board")

    new = commands.add_parser("new", help="start a machine, an algorithm, a plant or a vehicle, with a test")
    kinds = new.add_subparsers(required=True, metavar="KIND", dest="kind")
    machine = kinds.add_parser("machine", help="a folder NAME with a machine, two algorithms and a test")
    machine.add_argument("name", help="lower_snake_case")
    machine.add_argument("--package", action="store_true", help="as a ROS 2 package, for colcon")
    algorithm = kinds.add_parser(
        "algorithm", help="NAME.py and a test of it, in the folder of a machine or in this one"
    )
    algorithm.add_argument("name", help="lower_snake_case; the class has it in CamelCase")
    plant = kinds.add_parser(
        "plant", help="NAME.c, a model for fcsl-sim, and NAME.sim.json with a machine of this folder; with a test"
    )
    plant.add_argument("name", help="lower_snake_case; of the model")
    plant.add_argument("--machine", type=Path, metavar="FILE", help="machine JSON that the simulation flies")
    vehicle = kinds.add_parser(
        "vehicle", help="a package NAME with machine, simulation and tests of a vehicle that there is"
    )
    vehicle.add_argument("name", help="lower_snake_case")
    vehicle.add_argument("--like", required=True, metavar="VEHICLE", help="a package, such as quadrotor, or its folder")


def _add_cover(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser. Arguments after `--` must already be removed (_split_command)."""
    cover = commands.add_parser(
        "cover",
        help="run tests, and report which lines, branches and conditions of the algorithms they cover",
        usage="fcslc cover [-h] [--json FILE] [--fail-under KIND=PERCENT] MACHINE.json [...] -- COMMAND ...",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_COVER_EPILOG,
    )
    cover.add_argument("config", type=Path, nargs="+", metavar="MACHINE.json", help="machine to report on")
    cover.add_argument("--json", type=Path, metavar="FILE", help="also write the report to this file, as JSON")
    cover.add_argument(
        "--fail-under",
        action="append",
        default=[],
        metavar="KIND=PERCENT",
        help="exit with 1 if a machine has less; KIND is line, branch or mcdc; repeat for each",
    )


def _add_format(command: argparse.ArgumentParser) -> None:
    """Adds the option --format."""
    what = "text for people (default); json or sarif: one document on stdout, for editors and other programs"
    command.add_argument("--format", choices=FORMATS, default="text", help=what)
