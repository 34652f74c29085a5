# SPDX-License-Identifier: Apache-2.0
"""Lines that are drawn again and again in the same place of a terminal."""

from __future__ import annotations

import shutil
import sys

_HIDE_CURSOR, _SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"


class Screen:
    """Leaves the last drawing on the terminal."""

    def __init__(self) -> None:
        self._drawn = 0

    def __enter__(self) -> Screen:
        sys.stdout.write(_HIDE_CURSOR)
        return self

    def __exit__(self, *_: object) -> None:
        sys.stdout.write(_SHOW_CURSOR)
        sys.stdout.flush()

    @staticmethod
    def size() -> tuple[int, int]:
        """Columns, and rows for lines."""
        columns, rows = shutil.get_terminal_size()
        return columns, max(1, rows - 1)

    def draw(self, lines: list[str]) -> None:
        columns, rows = self.size()
        if len(lines) > rows:
            lines = [*lines[: rows - 1], f"… {len(lines) - rows + 1} lines more: no room"]
        shown = [line if len(line) <= columns else line[: columns - 1] + "…" for line in lines]
        back = f"\x1b[{self._drawn}A\r" if self._drawn else ""
        sys.stdout.write(back + "".join(f"{line}\x1b[K\n" for line in shown) + "\x1b[J")
        sys.stdout.flush()
        self._drawn = len(shown)
