# SPDX-License-Identifier: Apache-2.0
"""A line on standard error every 2 s, while flights are flown."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

_PERIOD_S = 2.0


class Progress:
    """`line`: what to say after these seconds since the beginning; empty: nothing yet."""

    def __init__(self, line: Callable[[float], str]):
        self._line = line
        self._begun = self._shown = time.monotonic()

    def show(self) -> None:
        now = time.monotonic()
        if now - self._shown >= _PERIOD_S:
            self._shown = now
            self.end()

    def end(self) -> None:
        """Says it now."""
        line = self._line(max(time.monotonic() - self._begun, 1e-9))
        if line:
            print(f"  {line}", file=sys.stderr)
