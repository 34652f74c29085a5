# SPDX-License-Identifier: Apache-2.0
"""What a command says while its user waits."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

#: Whoever waits longer wants to know for what, s.
_DELAY_S = 2.0


@contextmanager
def progress(text: str) -> Iterator[None]:
    """Prints a line on stderr if the block takes over two seconds."""
    timer = Timer(_DELAY_S, lambda: print(text, file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
