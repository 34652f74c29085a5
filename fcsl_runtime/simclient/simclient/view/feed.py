# SPDX-License-Identifier: Apache-2.0
"""Messages on their way to a Scene: gathered as bytes, decoded many at a time. For bags and for live nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..bag import stamps_s
from ..bag.states import StateSample
from ..ros.cdr import Layout
from .scene import Scene


class Feed:
    """Takes messages one by one and shows them at each `flush`.

    `layouts`: of the topics whose messages have a fixed one; `state_topic` and `read_state`: where the machine's states
    come from, and how one message is read. Messages of another layout are left out and counted in `refused`.
    """

    def __init__(
        self, scene: Scene, layouts: Mapping[str, Layout], state_topic: str, read_state: Callable[[bytes], StateSample]
    ):
        self._scene, self._layouts = scene, layouts
        self._state_topic, self._read_state = state_topic, read_state
        self._waiting: dict[str, list[bytes]] = {topic: [] for topic in layouts}
        self._states: list[bytes] = []
        self.refused = 0
        #: Time of the last output that was shown, in s; before the first one 0.
        self.now_s = 0.0

    @property
    def topics(self) -> set[str]:
        return {*self._layouts, self._state_topic}

    def take(self, topic: str, data: bytes) -> None:
        if topic == self._state_topic:
            self._states.append(data)
        elif self._layouts[topic].fits(data):
            self._waiting[topic].append(data)
        else:
            self.refused += 1

    def flush(self) -> None:
        """Shows what has come since the last time: outputs first, so that a transition knows where the vehicle is."""
        for topic, waiting in self._waiting.items():
            if not waiting:
                continue
            rows = self._layouts[topic].stack(waiting)
            waiting.clear()
            t_s = stamps_s(rows)
            self.now_s = max(self.now_s, float(t_s[-1]))
            self._scene.outputs(topic, t_s, {name: rows[name] for name in rows.dtype.names or ()})
        if self._states:
            self._scene.states([self._read_state(data) for data in self._states])
            self._states.clear()
