# SPDX-License-Identifier: Apache-2.0
"""The compiler's verbs of `fcsl`; each is a command of fcslc."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.verb import Commands, Verb, installed

if TYPE_CHECKING:
    from ..base.codes.code import Code

_MACHINES, _BUILD_SYSTEMS = "machines", "build systems"


def _command(name: str, arguments: Sequence[str]) -> int:
    from .main import main

    return main([name, *arguments], program="fcsl")


def _test(arguments: Sequence[str]) -> int:
    from .run_tests import main

    return main(arguments)


def _completion(arguments: Sequence[str]) -> int:
    from .complete import main

    return main(arguments)


def _completion_parser() -> argparse.ArgumentParser:
    from .complete import make_parser

    return make_parser()


def _parser(name: str) -> argparse.ArgumentParser:
    from .arguments import command_parser

    return command_parser(name, "fcsl")


def _verb(
    name: str, group: str, text: str, complete: Callable[[list[str]], list[str]] | None = None
) -> tuple[str, Verb]:
    return name, Verb(group, text, partial(_command, name), parser=partial(_parser, name), complete=complete)


def _complete_explain(words: list[str]) -> list[str]:
    from .explain import codes, function_names

    return [] if words[-1].startswith("-") else [*codes(), *function_names()]


def _complete_schema(words: list[str]) -> list[str]:
    return [] if words[-1].startswith("-") else [kind for package in installed() for kind in package.schemas]


def _codes() -> Mapping[str, Code]:
    from ..base.codes.pages import table

    return table()


#: The JSON Schema of machines.
MACHINE_SCHEMA = Path(__file__).parents[1] / "config" / "machine.schema.json"


def _board_schema() -> str:
    from ..board.board import board_schema

    return board_schema()


COMMANDS = Commands(
    verbs=dict(
        [
            _verb("new", _MACHINES, "start a machine, an algorithm, a plant or a vehicle, with a test"),
            _verb("check", _MACHINES, "report errors of machines, simulations and studies; write nothing"),
            _verb("build", _MACHINES, "compile machines to a shared library, or to C only"),
            ("test", Verb(_MACHINES, "run the tests of a folder with pytest", _test)),
            _verb("cover", _MACHINES, "run tests, and report which lines and conditions of algorithms they cover"),
            _verb("prove", _MACHINES, "show that requirements hold for all inputs, or how they fail"),
            _verb("interfaces", _MACHINES, "store the definitions of a machine's ROS 2 messages beside it"),
            _verb("graph", _MACHINES, "draw dataflow and state machine"),
            _verb("explain", _MACHINES, "explain a diagnostic code, with an example, or a function", _complete_explain),
            _verb(
                "schema",
                _MACHINES,
                "print the JSON Schema of a machine, a board, a simulation or a study",
                _complete_schema,
            ),
            (
                "completion",
                Verb("shell", "print a script that completes the command line", _completion, parser=_completion_parser),
            ),
            _verb("board", "hardware", "check a board against its machine, write its plan"),
            _verb("scan", _BUILD_SYSTEMS, "check that machine libraries call only functions allowed in a step"),
            _verb("externs", _BUILD_SYSTEMS, "print the link inputs of a target"),
            _verb("messages", _BUILD_SYSTEMS, "write the ROS 2 .msg files of the instances and their structs"),
        ]
    ),
    codes=_codes,
    schemas={"machine": partial(MACHINE_SCHEMA.read_text, encoding="utf-8"), "board": _board_schema},
)
