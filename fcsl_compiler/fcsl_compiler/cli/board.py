# SPDX-License-Identifier: Apache-2.0
"""`fcsl board`: checks a board and writes its plan."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..board.board import check_board
from ..board.plan import plan_text
from .arguments import PLAN_SUFFIX
from .report import Summary, print_report


def run(options: argparse.Namespace) -> int:
    board = check_board(options.config)
    output: Path = options.output or options.config.with_suffix(PLAN_SUFFIX)
    if output.resolve() == options.config.resolve():
        raise UsageError(f"the plan would replace the board `{options.config}`; name another file with -o")
    write_whole(output, plan_text(board))
    print_report(options, board.warnings, [Summary(board.path, board.machine, output)])
    if options.format == "text":
        print(output)
    return 0
