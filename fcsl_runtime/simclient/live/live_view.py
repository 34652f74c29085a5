# SPDX-License-Identifier: Apache-2.0
"""Telemetry in the rerun viewer, as it comes.

What came is taken out of the receiver's window many ticks at a time. A viewer that does not take what it was sent gets
nothing more until it has: the receiver goes on meanwhile, and ticks that its window lets go of are a gap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import ViewError
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from .recording import Recording
from .viewer import Viewer

#: How long what was sent may be on its way before the viewer counts as one that does not read, and how long the end waits, s.
_PATIENCE_S, _PARTING_S = 0.2, 5.0


class LiveView:
    """Shows in `viewer` what `telemetry` receives: a recording for each session, and a new one where its time jumps back.

    `tell` is given what a user should know, line by line. Every method may raise ViewError: the viewer is gone.
    """

    def __init__(self, telemetry: Telemetry, viewer: Viewer, tell: Callable[[str], object] = str):
        self._telemetry, self.viewer, self._tell = telemetry, viewer, tell
        self._last: Window | None = None
        self._recording: Recording | None = None
        self._behind = False
        self.ticks = self.missing = self.recordings = 0

    def show(self) -> None:
        """Shows what came since the last time, unless the viewer still has not taken that."""
        self.viewer.check()
        if self._telemetry.session is None:
            return
        if not self._taken(_PATIENCE_S):
            self._behind = True
            return
        window = self._telemetry.window(after=self._last)
        if not len(window):
            return
        backwards = np.flatnonzero(np.diff(window.tick) <= 0) + 1
        for rows in np.split(np.arange(len(window)), backwards):
            recording = self._recording
            if recording is None or not recording.goes_on(window, rows):
                recording = self._begin(window, int(window.tick[rows[0]]))
            self.missing += recording.take(window, rows, self._behind)
            self.ticks += len(rows)
        self._last, self._behind = window, False

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

    def _taken(self, patience_s: float) -> bool:
        return self._recording is None or self._recording.taken(patience_s)

    def end(self) -> None:
        """Shows the rest and ends the recording. Raises ViewError also when the viewer does not take that."""
        for _ in range(2):  # what was sent before, then the rest
            if not self._taken(_PARTING_S):
                raise ViewError("the viewer does not read: the end of the run is missing there")
            self.show()
        if self._recording is not None:
            self._recording.end()
