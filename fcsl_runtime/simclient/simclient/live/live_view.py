# SPDX-License-Identifier: Apache-2.0
"""Telemetry in the rerun viewer, as it comes.

What came is taken out of the receiver's window many ticks at a time. A viewer that does not take what it was sent gets
nothing more until it has: the receiver goes on meanwhile, and ticks that its window lets go of are a gap.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ..bag import Array
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from .recording import PARTING_S, Recording
from .viewer import Viewer

#: How long what was sent may be on its way before the viewer counts as one that does not read, s.
_PATIENCE_S = 0.2
#: Of one view. Each costs the viewer memory, and a file: whoever can send could otherwise ask for one per packet.
RECORDINGS_MAX = 100


class LiveView:
    """Shows in `viewer` what `telemetry` receives: a recording for each session, and a new one where its time jumps back, up
    to RECORDINGS_MAX; what would need more is left out.

    `tell` is given what a user should know, line by line. Every method may raise ViewError: the viewer is gone.
    """

    def __init__(self, telemetry: Telemetry, viewer: Viewer, tell: Callable[[str], object] = str):
        self._telemetry, self.viewer, self._tell = telemetry, viewer, tell
        self._last: Window | None = None
        self._recording: Recording | None = None
        self.behind, self._due_s = False, 0.0
        self._leaves_out = False
        self.ticks = self.missing = self.recordings = 0

    def show(self, rest: bool = False) -> None:
        """Shows what came since the last time, unless the viewer still has not taken that; with `rest` at once, else as often
        as a viewer can take."""
        self.viewer.check()
        if self._telemetry.session is None or time.monotonic() < self._due_s and not rest:
            return
        if not self.taken(_PATIENCE_S):
            if not self.behind:
                self._tell("the viewer does not read: what comes waits for it, as long as there is room")
            self.behind = True
            return
        window = self._telemetry.window(after=self._last)
        if not len(window):
            return
        backwards = np.flatnonzero(np.diff(window.tick) <= 0) + 1
        for rows in np.split(np.arange(len(window)), backwards):
            recording = self._recording
            if recording is None or not recording.goes_on(window, rows):
                if recording is not None and self.recordings == RECORDINGS_MAX:
                    self._leave_out(recording, window, rows)
                    continue
                recording = self._begin(window, int(window.tick[rows[0]]))
            self.missing += recording.take(window, rows, self.behind)
            self.ticks += len(rows)
        self._last, self.behind = window, False
        assert self._recording is not None
        self._due_s = time.monotonic() + self._recording.pieces / self.viewer.pieces_hz

    def _begin(self, window: Window, tick: int) -> Recording:
        """A new recording; the one before it says why it ends."""
        former, self.recordings = self._recording, self.recordings + 1
        why = ""
        if former is not None:
            restarted = former.session != window.session
            why = "the sender was restarted" if restarted else f"the sender went back from tick {former.tick} to {tick}"
            former.end(f"{why}: goes on in the next recording")
        self._recording = Recording(self.viewer, window, self.recordings, why)
        self._tell(self._recording.title)
        return self._recording

    def _leave_out(self, recording: Recording, window: Window, rows: Array) -> None:
        """Rows that do not belong to this recording, which is the last; said once."""
        if not self._leaves_out:
            self._leaves_out = True
            said = f"{RECORDINGS_MAX} recordings are the most of one view: left out is what would begin another"
            recording.note(said)
            self._tell(f"{said}; start fcsl-view anew to see it")
        recording.pass_over(window, rows)
        self.missing += len(rows)

    def taken(self, patience_s: float) -> bool:
        """Whether the viewer has taken what it was sent, at the latest after this time."""
        return self._recording is None or self._recording.taken(patience_s)

    def end(self) -> None:
        """Shows the rest and ends the recording. Raises ViewError also when the viewer does not take that."""
        self.taken(PARTING_S)
        self.show(rest=True)
        if self._recording is not None:
            self._recording.end()
