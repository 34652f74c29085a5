# SPDX-License-Identifier: Apache-2.0
"""Lines that are drawn again in place on a terminal."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from typing import Self

_HIDE_CURSOR, _SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"
_FALLBACK_SIZE = (80, 24)


class Screen:
    """Hides the cursor while it is open, and leaves the last drawing where it is."""

    def __init__(self) -> None:
        self._drawn = 0

    def __enter__(self) -> Self:
        sys.stdout.write(_HIDE_CURSOR)
        return self

    def __exit__(self, *_: object) -> None:
        sys.stdout.write(_SHOW_CURSOR)
        sys.stdout.flush()

    @staticmethod
    def size() -> tuple[int, int]:
        """Columns, and lines for a drawing."""
        width, height = shutil.get_terminal_size(_FALLBACK_SIZE)
        return width, height - 1

    def draw(self, lines: Sequence[str]) -> None:
        """Draws over the last drawing; what has no room is cut."""
        width, height = self.size()
        shown, room = list(lines), max(1, height)
        if len(shown) > room:
            shown[room - 1 :] = [f"… {len(shown) - room + 1} lines more: no room"]
        shown = [line if len(line) <= width else line[: width - 1] + "…" for line in shown]
        back = f"\x1b[{self._drawn}A\r" if self._drawn else ""
        sys.stdout.write(back + "".join(f"{line}\x1b[K\n" for line in shown) + "\x1b[J")
        sys.stdout.flush()
        self._drawn = len(shown)
