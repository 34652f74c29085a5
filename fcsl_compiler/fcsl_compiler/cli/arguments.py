# SPDX-License-Identifier: Apache-2.0
"""The command line of fcslc. It imports no command, so that help and errors of usage come at once."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..base.examples import add_examples, subcommands
from ..base.version import add_version
from ..model.choices import BACKENDS, DEFAULT_BACKEND, DEFAULT_TARGET

#: Results that a build prints (driver/passes.py), and how the plan of a board ends.
DUMPS = ("parse", "check", "schedule", "verify", "lower", "emit", "types")
PLAN_SUFFIX = ".plan"

_EXAMPLES = {
    "": "check craft.json",
    "check": "craft.json --strict",
    "build": "craft.json -o build --report",
    "board": "craft.board.json",
    "explain": "E402 kf_gain",
    "scan": "build/libcraft.so",
    "externs": "craft.json --target board",
    "messages": "craft.json -o msg",
    "interfaces": "craft.json",
    "graph": "craft.json -o craft.svg",
    "schema": "simulation",
    "new": "machine craft",
    "new machine": "craft",
    "new algorithm": "slew",
    "new plant": "mass --machine craft.json",
    "new vehicle": "falcon --like quadrotor",
    "prove": "craft.json --only LND-8 -o tests",
    "cover": "craft.json --fail-under mcdc=100 -- python3 -m pytest test",
}
_TARGET_HELP = f"which of the machine's `targets` its externs are linked from (default: {DEFAULT_TARGET})"
_STRICT_HELP = "every input without connection or channel must be listed in the `inputs` of its instance"
_COVER_EPILOG = """\
Every machine that COMMAND compiles (AlgTwin.from_config, fcsl-sim) is built with coverage probes. Such a build must not
fly, and other hosts reject it. PyTwin and existing libraries are not measured. The same without fcslc:
python3 -m pytest --fcsl-cover.

lines     lines on which a statement begins
branches  both outcomes of every decision (a Boolean expression that is the condition of an `if` or a conditional
          expression, or whose value is used), and for each loop that may run no iteration: one iteration, and none
MC/DC     conditions that decided their decision's outcome independently, both as True and as False (masking MC/DC as in
          DO-178C and CAST-10); a chain a < b < c consists of the conditions a < b and b < c
"""


def parse(arguments: Sequence[str], program: str = "fcslc") -> argparse.Namespace:
    """The options; `subcommand` names the module of the command. Wrong ones end the program with status 2."""
    own, command = _split_command(arguments)
    return _parser(program).parse_args(own, argparse.Namespace(command=command))


def command_parser(name: str, program: str) -> argparse.ArgumentParser:
    """That of one command."""
    return subcommands(_parser(program))[name]


def _split_command(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Splits the arguments of `fcsl cover` at the first `--`: its own arguments, and the command. For other
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


def _parser(program: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=program, description="Compiles machines (JSON and algorithms) to native C.")
    add_version(parser, "fcsl_compiler", __file__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="subcommand")

    check = _add(commands, "check", "report errors; write nothing")
    check.add_argument("config", type=Path, nargs="+", help="machine JSON")
    check.add_argument("--strict", action="store_true", help=_STRICT_HELP)
    _add_format(check)

    _add_build(commands)
    _add_board(commands)

    why = _add(commands, "explain", "explain a diagnostic code, with an example, or a function")
    why.add_argument("what", nargs="*", help="a code such as E402, or a function such as kf_gain; none: list all")

    scan = _add(commands, "scan", "check that machine libraries call only functions allowed in a step")
    scan.add_argument("library", type=Path, nargs="+", help="shared library of machines")
    scan.add_argument(
        "--objects", type=Path, metavar="FOLDER", help="folder of the machines' object files; also print stack bounds"
    )
    scan.add_argument(
        "--emitted", type=Path, metavar="FOLDER", help="folder of the generated C; allows calls of the declared externs"
    )

    externs = _add(commands, "externs", "print the link inputs of a target, for build systems")
    externs.add_argument("config", type=Path, nargs="+", help="machine JSON")
    externs.add_argument("--target", metavar="NAME", default=DEFAULT_TARGET, help=_TARGET_HELP)

    messages = _add(commands, "messages", "write the ROS 2 .msg files of the instances and their structs")
    messages.add_argument("config", type=Path, nargs="+", help="machine JSON")
    messages.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="folder for the .msg files"
    )
    messages.add_argument(
        "--package", metavar="PACKAGE", help="the ROS 2 package that builds them; it must contain the machines"
    )
    messages.add_argument(
        "--sources",
        type=Path,
        metavar="FILE",
        help="write the list of input files here, one per line, for build systems",
    )
    _add_authoring(commands)
    _add_prove(commands)
    _add_cover(commands)
    add_examples(parser, _EXAMPLES)
    return parser


def _add(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, text: str
) -> argparse.ArgumentParser:
    """A command with its sentence."""
    return commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")


def _add_build(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    build = _add(commands, "build", "compile to a shared library, or to C only")
    build.add_argument("config", type=Path, nargs="+", help="machine JSON; several go into one library")
    build.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="output folder (default: build beside the first config)"
    )
    build.add_argument("--name", metavar="NAME", help="library name (default: the first machine's)")
    build.add_argument("--c-only", action="store_true", help="write C (and Nim), header and map, do not compile them")
    build.add_argument(
        "--depfile", type=Path, metavar="FILE", help="write the dependencies of the C files, for make and ninja"
    )
    build.add_argument("--backend", choices=BACKENDS, default=DEFAULT_BACKEND, help="language of the generated source")
    build.add_argument("--target", metavar="NAME", default=DEFAULT_TARGET, help=_TARGET_HELP)
    build.add_argument(
        "--instances", metavar="NAME,…", help="build a subset machine with only these instances (one config)"
    )
    build.add_argument(
        "--processor",
        metavar="PROCESSOR",
        help="build a static library for a processor without an operating system (docs/hardware/firmware.md): cortex-m7, "
        'cortex-m4, or a C compiler and its options, as "arm-none-eabi-gcc -mcpu=cortex-m33 -mthumb"',
    )
    build.add_argument("--strict", action="store_true", help=_STRICT_HELP)
    build.add_argument(
        "--times", action="store_true", help="let hosts measure the time of each instance (fcsl var top)"
    )
    build.add_argument("--dump", choices=DUMPS, help="print the result of a pass, or the types of locals, and stop")
    what = "print a resource report: order, latencies, operations, instructions, stack, sizes, load"
    build.add_argument("--report", action="store_true", help=what)
    _add_format(build)


def _add_board(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    board = _add(commands, "board", "check a board against its machine, write its plan")
    board.add_argument("config", type=Path, help="board JSON")
    board.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=f"the plan (default: beside the board, suffix {PLAN_SUFFIX})"
    )
    _add_format(board)


def _add_authoring(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the commands to fcslc's parser."""
    graph = _add(commands, "graph", "draw dataflow and state machine")
    graph.add_argument("config", type=Path, help="machine JSON")
    graph.add_argument("--state", metavar="STATE", help="show one state (default: all)")
    graph.add_argument("--fold", action="store_true", help="draw each part as one box")
    graph.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=".svg, .mmd (Mermaid) or .md; default: Mermaid on stdout"
    )

    text = "store the definitions of a machine's ROS 2 messages beside it, as craft.interfaces.json"
    _add(commands, "interfaces", text).add_argument("config", type=Path, help="machine JSON")

    schema = _add(commands, "schema", "print the JSON Schema of a kind of file, for editors")
    schema.add_argument("of", nargs="?", default="machine", help="machine (default), board, simulation or study")

    new = _add(commands, "new", "start a machine, an algorithm, a plant or a vehicle, with a test")
    kinds = new.add_subparsers(required=True, metavar="KIND", dest="kind")
    machine = _add(kinds, "machine", "a folder NAME with a machine, two algorithms and a test")
    machine.add_argument("name", help="lower_snake_case")
    machine.add_argument("--package", action="store_true", help="as a ROS 2 package, for colcon")
    algorithm = _add(kinds, "algorithm", "NAME.py and a test of it, in the folder of a machine or in this one")
    algorithm.add_argument("name", help="lower_snake_case; the class has it in CamelCase")
    plant = _add(
        kinds, "plant", "NAME.c, a model for fcsl-sim, and NAME.sim.json with a machine of this folder; with a test"
    )
    plant.add_argument("name", help="lower_snake_case; of the model")
    plant.add_argument("--machine", type=Path, metavar="FILE", help="machine JSON that the simulation flies")
    vehicle = _add(
        kinds, "vehicle", "a package NAME that begins as a copy of an existing vehicle: machine, simulation and tests"
    )
    vehicle.add_argument("name", help="lower_snake_case")
    vehicle.add_argument("--like", required=True, metavar="VEHICLE", help="a package, such as quadrotor, or its folder")


def _add_prove(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    prove = _add(commands, "prove", "show that requirements and assertions hold for all inputs, or how they fail")
    prove.add_argument("config", type=Path, help="machine JSON")
    prove.add_argument("--requirements", type=Path, metavar="FILE", help="instead of the machine's own")
    prove.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="ID",
        help="a requirement, an assertion or a state; repeat for more",
    )
    prove.add_argument(
        "--seconds", type=float, default=60.0, metavar="SECONDS", help="time for all of them (default: 60)"
    )
    prove.add_argument("--depth", type=int, default=24, metavar="N", help="ticks from the beginning (default: 24)")
    prove.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="write a pytest test for each that does not hold"
    )
    prove.add_argument(
        "--json", action="store_const", const="json", default="text", dest="format", help="print one JSON document"
    )


def _add_cover(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser. Arguments after `--` must already be removed (_split_command)."""
    cover = commands.add_parser(
        "cover",
        help="run tests, and report which lines, branches and conditions of the algorithms they cover",
        description="Runs tests, and reports which lines, branches and conditions of the algorithms they cover.",
        usage="%(prog)s [-h] [-o FILE] [--fail-under KIND=PERCENT] MACHINE.json [...] -- COMMAND ...",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_COVER_EPILOG,
    )
    cover.add_argument("config", type=Path, nargs="+", metavar="MACHINE.json", help="machine to report on")
    cover.add_argument("-o", "--output", type=Path, metavar="FILE", help="also write the report there, as JSON")
    cover.add_argument(
        "--fail-under",
        action="append",
        default=[],
        metavar="KIND=PERCENT",
        help="exit with 1 if a machine has less; KIND is line, branch or mcdc; repeat for each",
    )


def _add_format(command: argparse.ArgumentParser) -> None:
    """Adds what chooses the form of a report (report.py)."""
    forms = command.add_mutually_exclusive_group()
    for form, what in (("json", "one JSON document"), ("sarif", "one document in SARIF 2.1.0")):
        forms.add_argument(
            f"--{form}",
            action="store_const",
            const=form,
            default="text",
            dest="format",
            help=f"print {what} on stdout, for editors and other programs",
        )
