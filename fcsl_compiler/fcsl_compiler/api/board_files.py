# SPDX-License-Identifier: Apache-2.0
"""Board files, checked."""

from ..board.backends import Backend
from ..board.board import check_board

__all__ = [
    "Backend",
    "check_board",
]
