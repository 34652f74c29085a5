# SPDX-License-Identifier: Apache-2.0
"""`fcslc board`: checks a board and writes its plan."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.files import write_whole
from ..base.usage import UsageError
from ..board.board import check_board
from ..board.plan import plan_text
from .build import add_format, print_report
from .report import Summary

_SUFFIX = ".plan"


def add_board(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    board = commands.add_parser("board", help="check a board against its machine, write its plan")
    board.add_argument("config", type=Path, help="board JSON")
    board.add_argument("-o", "--output", type=Path, help=f"the plan (default: beside the board, suffix {_SUFFIX})")
    add_format(board)
    board.set_defaults(run=_board)


def _board(options: argparse.Namespace) -> int:
    board = check_board(options.config)
    output: Path = options.output or options.config.with_suffix(_SUFFIX)
    if output.resolve() == options.config.resolve():
        raise UsageError(f"the plan would replace the board `{options.config}`; name another file with -o")
    write_whole(output, plan_text(board))
    print_report(options, board.warnings, [Summary(board.path, board.machine, output)])
    if options.format == "text":
        print(output)
    return 0
