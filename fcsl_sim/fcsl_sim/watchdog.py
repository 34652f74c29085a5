# SPDX-License-Identifier: Apache-2.0
"""Ends a run whose model crashes or does not return, with a message that names it.

While native code runs, Python handles no signal: the main thread cannot. A thread looks whether one and the same call of
a model goes on and on.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from contextlib import suppress
from types import TracebackType

from .errors import SimError
from .native import Simulation, running_call, watch_crashes

#: Between two looks.
_POLL_S = 0.25
#: Looks at one call after which it hangs: 10 s, of which a stopped process counts none.
_POLLS = 40
#: After a signal.
_POLLS_OF_SIGNAL = 8
_EXIT_FAILED = 2


class Watchdog:
    """A context manager around the life of a simulation in `fcsl-sim`. as_json: the end is told as JSON, too. `sim`: the
    simulation once it is open, whose bag is then closed."""

    def __init__(self, as_json: bool):
        self.sim: Simulation | None = None
        self._as_json = as_json
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._signalled, self._wake = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def __enter__(self) -> Watchdog:
        self._before = signal.set_wakeup_fd(self._wake, warn_on_full_buffer=False)
        watch_crashes(True, self._as_json)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()
        watch_crashes(False, self._as_json)
        signal.set_wakeup_fd(self._before)
        os.close(self._signalled)
        os.close(self._wake)

    def _watch(self) -> None:
        number, entry, polls = 0, -1, 0
        while not self._over.wait(_POLL_S):
            number = self._signal() or number
            at = running_call()
            polls = polls + 1 if at is not None and at.entry == entry else 0
            entry = at.entry if at is not None else -1
            if at is not None and polls >= (_POLLS_OF_SIGNAL if number else _POLLS):
                message = f"`{at.function}` of `{at.instance}` does not return, at {at.time_s:.9f} s"
                self._end(message, number)

    def _signal(self) -> int:
        """The last SIGINT or SIGTERM that has come, or 0."""
        numbers: list[int] = []
        with suppress(BlockingIOError):
            numbers = [n for n in os.read(self._signalled, 1024) if n in (signal.SIGINT, signal.SIGTERM)]
        return numbers[-1] if numbers else 0

    def _end(self, message: str, number: int) -> None:
        with suppress(SimError):
            if self.sim is not None:
                self.sim.record_stop()  # the thread that records is in the model
        print(f"fcsl-sim: error: {message}", file=sys.stderr, flush=True)
        if self._as_json:
            print(json.dumps({"end": "error", "error": message}), flush=True)
        os._exit(128 + number if number else _EXIT_FAILED)
