# SPDX-License-Identifier: Apache-2.0
"""`fcslc schema`: the JSON Schema of a machine or a board."""

from __future__ import annotations

import argparse

from ..board.board import board_schema
from .scaffold import SCHEMA


def run(options: argparse.Namespace) -> int:
    print(board_schema() if options.board else SCHEMA.read_text(), end="")
    return 0
