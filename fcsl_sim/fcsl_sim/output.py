# SPDX-License-Identifier: Apache-2.0
"""Lines on standard output that cannot end a flight."""

from __future__ import annotations

import os
import sys


def show(text: str) -> None:
    """Prints a line at once. Once its reader has gone (`fcsl sim … | head -1`), lines are dropped and the run goes on."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
