# SPDX-License-Identifier: Apache-2.0
"""Shows live telemetry in the rerun viewer.

Rows are taken out of the receiver's window many ticks at a time. A viewer that has not read the data sent to it gets no
more until it has. The receiver continues meanwhile; ticks that its window discards become a gap.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ..bag import Array
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from ..view.views import Views
from .recording import PARTING_S, Recording
from .viewer import Viewer

#: A viewer that has not read the sent data after this time, in s, counts as stuck.
_TIMEOUT_S = 0.2
#: Most recordings of one view. Each uses memory of the viewer and a file, and any sender could cause one per packet.
RECORDINGS_MAX = 100


class LiveView:
    """Shows in `viewer` the telemetry that `telemetry` receives. Each session has a recording.

    A new recording also begins where the session's time jumps back, up to RECORDINGS_MAX; further ones are left out.
    `notify` receives each message for the user, one line per call. `views` takes the place of what senders choose to
    show. Every method raises ViewError if the viewer has ended.
    """

    def __init__(
        self,
        telemetry: Telemetry,
        viewer: Viewer,
        notify: Callable[[str], object] = str,
        views: Views | None = None,
    ):
        self._telemetry, self.viewer, self._notify, self._views = telemetry, viewer, notify, views
        self._last: Window | None = None
        self._recording: Recording | None = None
        self.behind, self._due_s = False, 0.0
        self._leaves_out = False
        self.ticks = self.missing = self.recordings = 0

    def show(self, rest: bool = False) -> None:
        """Shows rows received since the last call, unless the viewer has not yet read those sent before.

        The rate is limited to what a viewer can take, except with `rest`, which shows all rows at once.
        """
        self.viewer.check()
        if self._telemetry.session is None or time.monotonic() < self._due_s and not rest:
            return
        if not self.taken(_TIMEOUT_S):
            if not self.behind:
                self._notify("the viewer does not read: new telemetry is kept for it, as long as there is room")
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
        """Begins a recording; the one before it notes why it ends."""
        former, self.recordings = self._recording, self.recordings + 1
        why = ""
        if former is not None:
            restarted = former.session != window.session
            why = "the sender was restarted" if restarted else f"the sender went back from tick {former.tick} to {tick}"
            former.end(f"{why}: goes on in the next recording")
        self._recording = Recording(self.viewer, window, self.recordings, why, self._views)
        self._notify(self._recording.title)
        return self._recording

    def _leave_out(self, recording: Recording, window: Window, rows: Array) -> None:
        """Skips rows that need a recording beyond the last allowed one; reports this once."""
        if not self._leaves_out:
            self._leaves_out = True
            text = f"a view has at most {RECORDINGS_MAX} recordings: telemetry that needs another is left out"
            recording.note(text)
            self._notify(f"{text}; restart fcsl view to see it")
        recording.pass_over(window, rows)
        self.missing += len(rows)

    def taken(self, timeout_s: float) -> bool:
        """Waits up to `timeout_s` seconds; returns whether the viewer has read all data sent to it."""
        return self._recording is None or self._recording.taken(timeout_s)

    def end(self) -> None:
        """Shows the remaining rows and ends the recording. Raises ViewError if the viewer does not read them."""
        self.taken(PARTING_S)
        self.show(rest=True)
        if self._recording is not None:
            self._recording.end()
