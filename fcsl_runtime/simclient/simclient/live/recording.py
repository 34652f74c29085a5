# SPDX-License-Identifier: Apache-2.0
"""One recording of telemetry in a viewer: rows of windows become lines, state lanes, poses and notes."""

from __future__ import annotations

import numpy as np

from ..bag import Array
from ..bag.states import StateSample
from ..errors import ViewError
from ..telemetry.window import Window
from ..view.blueprint import Plan
from ..view.scene import Scene
from ..view.signals import UNKNOWN
from ..view.views import Views, views_or_remark
from .channels import NAME_MAX, STATE, channels_of, is_health
from .viewer import Viewer

_NS = 1_000_000_000
#: How long the end of a recording waits for its viewer, in s.
PARTING_S = 5.0
#: Marks a row without known values.
_NOTHING = -1


class Recording:
    """Opens a stream of `viewer` for the session of the window. Raises ViewError.

    `number` counts recordings from 1; `why` is the reason that the one before it ended. `views` takes the place of what
    the sender chooses to show.
    """

    def __init__(self, viewer: Viewer, window: Window, number: int, why: str, views: Views | None = None):
        configuration = window.configuration
        self._machine, self._every = configuration.machine, configuration.every
        rate = f"{self._machine.tick_hz} Hz" + (f", one tick in {self._every}" if self._every > 1 else "")
        name = self._machine.name[:NAME_MAX]
        session = f"session {window.session:016x} of {name} at {rate}, from tick {window.tick[0]}"
        #: Notes for the beginning of the recording.
        self.title = f"{why}; {session}" if why else session
        remark = ""
        if views is None:
            views, remark = views_or_remark(self._machine.views)
        self._channels = channels_of(self._machine.name, configuration.channels, views, remark)
        self._stream = viewer.open(f"fcsl_{name}", f"{name}, {number}")
        cast = self._channels.cast
        self._scene = Scene(self._stream, cast)
        self._stream.send_blueprint(Plan(cast, self._scene.world, None).blueprint())
        self._sequence, self._time_ns, self._state = 0, 0, UNKNOWN
        self.session = window.session
        #: The last tick that is shown, if `begun`.
        self.tick = 0
        self.begun = False

    @property
    def pieces(self) -> int:
        """The number of entities that each `take` writes to."""
        return sum(map(len, self._channels.paths.values()))

    def goes_on(self, window: Window, rows: Array) -> bool:
        """Whether these rows belong to this recording: same session, and later than what is shown."""
        return bool(window.session == self.session and window.tick[rows[0]] > self.tick)

    def take(self, window: Window, rows: Array, behind: bool) -> int:
        """Shows these rows, in rising ticks; returns the number of missing ticks.

        `behind`: the window may have discarded rows.
        """
        ticks, times_ns, sequences = window.tick[rows], window.time_ns[rows], window.sequence[rows]
        if not self.begun:
            self.begun = True
            self.tick, self._sequence = int(ticks[0]) - self._every, int(sequences[0]) - 1
            self._greet(times_ns[0] / _NS)
        steps = np.diff(ticks, prepend=self.tick)
        gaps = np.flatnonzero(steps != self._every)
        # After the last row before a gap, a row of unknown values ends lines and lanes.
        ends_ns = np.concatenate(([self._time_ns], times_ns))[gaps] + self._every * _NS // self._machine.tick_hz
        picked = np.insert(rows, gaps, _NOTHING)
        shown_ns = np.insert(times_ns, gaps, ends_ns)
        missing = self._note_missing(ticks, sequences, gaps, ends_ns, behind) if len(gaps) else 0
        self._scene.show(self._values(window, picked, shown_ns / _NS), self._states(window, picked, shown_ns))
        self.tick, self._sequence, self._time_ns = int(ticks[-1]), int(sequences[-1]), int(times_ns[-1])
        self._scene.until(self._time_ns / _NS)
        return missing

    def pass_over(self, window: Window, rows: Array) -> None:
        """Skips these rows, which arrived but are not shown here: they do not count as lost."""
        self._sequence = int(window.sequence[rows[-1]])

    def note(self, text: str) -> None:
        """Adds a log line at the time of the last row shown."""
        self._scene.note(self._time_ns / _NS, text, "WARN")

    def _greet(self, t_s: float) -> None:
        self._scene.note(t_s, self.title)
        if self._channels.too_large:
            paths = ", ".join(self._channels.too_large)
            self._scene.note(t_s, f"left out, because they have too many elements: {paths}", "WARN")
        if self._scene.left_out:
            self._scene.note(t_s, f"left out of the first page: {', '.join(self._scene.left_out)}")

    def _note_missing(self, ticks: Array, sequences: Array, gaps: Array, ends_ns: Array, behind: bool) -> int:
        """Notes missing ticks and the cause."""
        steps = np.diff(ticks, prepend=self.tick)[gaps]
        lacking = np.diff(sequences, prepend=self._sequence)[gaps] - 1
        missing = np.maximum(steps // self._every - 1, 0)
        late = int(lacking[0]) if behind and gaps[0] == 0 else 0
        reasons = {
            "lost in transit": int(lacking.sum()) - late,
            "discarded, because the viewer was too slow": late,
            "not sent": int((missing - np.minimum(missing, lacking)).sum()),
        }
        why = "; ".join(f"{count} {reason}" for reason, count in reasons.items() if count)
        first, last = int(ticks[gaps[0]] - steps[0] + self._every), int(ticks[gaps[-1]] - self._every)
        total = int(missing.sum())
        self._scene.note(
            ends_ns[0] / _NS, f"{total} ticks missing, from {first} to {last} in {len(gaps)} gaps: {why}", "WARN"
        )
        return total

    def _values(self, window: Window, picked: Array, t_s: Array) -> dict[str, tuple[Array, dict[str, Array]]]:
        """Times and fields by topic; unknown where `picked` is _NOTHING."""
        nothing, values = picked == _NOTHING, {}
        for topic, paths in self._channels.paths.items():
            columns: dict[str, Array] = {}
            for name, path in paths.items():
                numbers = window.numbers(path)
                numbers = numbers if self._machine.fields[path].shape else numbers[:, 0]
                if is_health(path):
                    columns[name] = np.where(nothing, UNKNOWN, numbers[picked])
                else:
                    columns[name] = numbers[picked].astype(np.float64)
                    columns[name][nothing] = np.nan
            values[topic] = t_s, columns
        return values

    def _states(self, window: Window, picked: Array, times_ns: Array) -> list[StateSample]:
        """Changes of the machine's state."""
        if STATE not in self._machine.fields or self._machine.fields[STATE].type != "state":
            return []
        numbers = np.where(picked == _NOTHING, UNKNOWN, window.numbers(STATE)[picked, 0])
        changes = np.flatnonzero(np.diff(numbers, prepend=self._state))
        names = [self._name(number) for number in numbers[changes].tolist()]
        self._state = int(numbers[-1])
        return [StateSample(0, ns, n, "") for ns, n in zip(times_ns[changes].tolist(), names, strict=True)]

    def _name(self, number: int) -> str:
        states = self._machine.states
        return "" if number < 0 else states[number] if number < len(states) else str(number)

    def taken(self, timeout_s: float) -> bool:
        """Waits up to `timeout_s` seconds; returns whether all data have arrived.

        Raises ViewError if the viewer has ended.
        """
        try:
            self._stream.flush(timeout_sec=timeout_s)
        except RuntimeError as error:
            if "timed out" in str(error):
                return False
            raise ViewError(f"the viewer is gone: {error}") from None
        return True

    def end(self, text: str = "") -> None:
        """Closes the stream. Raises ViewError if the viewer does not read the data sent to it."""
        if text:
            self._scene.note(self._time_ns / _NS, text)
        if not self.taken(PARTING_S):
            raise ViewError("the viewer does not read: the end of a recording is missing there")
        self._stream.disconnect()
