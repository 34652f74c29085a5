# SPDX-License-Identifier: Apache-2.0
"""The command line of fcsl var. It imports no command, so that help and errors of usage come at once."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial

from fcsl_compiler.api.command_line import Command, add_examples

#: Adds the options of a command.
Fill = Callable[[argparse.ArgumentParser], object]

_EPILOG = """\
The machine is that of --socket (a path, or tcp:HOST:PORT with --token FILE), else of FCSL_SOCKET. Without both, a command that
only reads finds the flight program or simulation of this user by itself, if one alone runs with --socket. A path is a field, a part
of it (p[0], p[1:3]) or, for get,
a prefix of several (nav.outputs). Exit status: 0; 1 if the machine refuses; 2 if there is none, or for wrong usage."""


def _add_common(parser: argparse.ArgumentParser) -> None:
    """Options that may precede or follow the command; a missing one must not override a given one."""
    absent = argparse.SUPPRESS
    parser.add_argument("--socket", metavar="ADDRESS", default=absent, help="address of the machine's variable server")
    parser.add_argument("--token", metavar="FILE", default=absent, help="the token of a TCP server")
    what = "output for programs: one JSON value (watch: one per line)"
    parser.add_argument("--json", action="store_true", default=absent, help=what)


_EXAMPLES = {
    "": "get nav.outputs --json",
    "list": "nav.outputs",
    "get": "nav.outputs.x machine.tick",
    "set": "nav.parameters.gain=0.5",
    "watch": "nav.outputs.x --every 10",
    "plot": "nav.outputs.x --window 1000",
    "eval": '"abs(nav.outputs.x) > 1"',
    "tick": "100",
    "pause": "",
    "resume": "",
    "state": "--json",
    "stats": "--json",
    "top": "",
    "set-state": "IDLE",
    "save": "craft.checkpoint",
    "restore": "craft.checkpoint",
    "save-parameters": "params.yaml",
    "load-parameters": "params.yaml",
    "describe": "nav.outputs.x",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl var",
        description="The values of a running machine.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_common(parser)
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Command, prog=parser.prog)
    for name, run, text, fill in _COMMANDS:
        commands.add_parser(name, help=text, description=text, fill=partial(_fill, name, run, fill))
    add_examples(parser, _EXAMPLES)
    return parser


def _fill(name: str, run: str, fill: Fill, command: argparse.ArgumentParser) -> None:
    command.set_defaults(run=run, command=name)
    _add_common(command)
    fill(command)


def _paths(command: argparse.ArgumentParser) -> None:
    command.add_argument("paths", nargs="+", metavar="PATH")


def _nothing(command: argparse.ArgumentParser) -> None:
    pass


def _set(command: argparse.ArgumentParser) -> None:
    command.add_argument("values", nargs="+", metavar="PATH=VALUE")
    command.add_argument("--allow-non-finite", action="store_true", help="accept nan, inf and -inf")


def _watch(command: argparse.ArgumentParser) -> None:
    _paths(command)
    command.add_argument("--every", type=_count, default=1, metavar="N", help="every N-th tick (default 1)")
    command.add_argument("--ticks", type=_count, metavar="N", help="end with the last sample due within N ticks")


def _plot(command: argparse.ArgumentParser) -> None:
    _watch(command)
    command.add_argument("--window", type=_count, default=500, metavar="N", help="samples in the picture (default 500)")


def _save(command: argparse.ArgumentParser) -> None:
    command.add_argument("file")
    command.add_argument("--remote", action="store_true", help="FILE is in the program's own folder (--checkpoints)")


def _restore(command: argparse.ArgumentParser) -> None:
    _save(command)
    what = "also accept a checkpoint of other sources with the same layout"
    command.add_argument("--ignore-source-hash", action="store_true", help=what)


def _save_parameters(command: argparse.ArgumentParser) -> None:
    command.add_argument("file")
    command.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) < 2**32:
        raise argparse.ArgumentTypeError(f"a whole number from 1 on wanted, not {text!r}")
    return int(text)


#: Name, module of this folder and its function, help, options.
_COMMANDS: tuple[tuple[str, str, str, Fill], ...] = (
    (
        "list",
        "read.list_fields",
        "lists paths, with type, unit and meaning",
        lambda c: c.add_argument("prefix", nargs="?", default=""),
    ),
    ("get", "read.get", "prints values, all of one tick", _paths),
    ("set", "write.set_values", "writes values before the next tick: all, or none if one is refused", _set),
    (
        "watch",
        "follow.watch_values",
        "prints values while the machine runs: in place on a terminal, else a line per sample; until Ctrl-C",
        _watch,
    ),
    ("plot", "follow.plot_values", "plots curves in the terminal, until Ctrl-C", _plot),
    ("eval", "read.evaluate", "computes with fields: 'abs(nav.outputs.x) > 1'", lambda c: c.add_argument("expression")),
    (
        "tick",
        "write.tick",
        "runs ticks, while paused",
        lambda c: c.add_argument("count", nargs="?", type=_count, default=1),
    ),
    ("pause", "request.request", "stops the machine; then only tick runs it", _nothing),
    ("resume", "request.request", "runs the machine in real time", _nothing),
    ("state", "request.request", "prints tick, state, next state", _nothing),
    ("stats", "request.request", "prints the program's counters and the lateness of its ticks", _nothing),
    (
        "top",
        "top.top",
        "prints where the time of the ticks goes, of a machine built with --times: live on a terminal, until Ctrl-C",
        _nothing,
    ),
    ("set-state", "write.set_state", "enters a state at once", lambda c: c.add_argument("state")),
    ("save", "checkpoints.save", "writes a checkpoint", _save),
    ("restore", "checkpoints.restore", "restores a checkpoint", _restore),
    (
        "save-parameters",
        "parameters.save",
        "writes the parameters that differ from the compiled ones to a parameter file",
        _save_parameters,
    ),
    (
        "load-parameters",
        "parameters.load",
        "writes the values of a parameter file before the next tick: all, or none if one is refused",
        lambda c: c.add_argument("file"),
    ),
    (
        "describe",
        "read.describe",
        "describes a field; without a path, the machine",
        lambda c: c.add_argument("path", nargs="?"),
    ),
)
