# SPDX-License-Identifier: Apache-2.0
"""Buffers messages for a Scene and decodes many at a time. For bags and for live nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..bag import Array, stamps_s
from ..bag.states import StateSample
from ..ros.cdr import Layout
from .scene import Scene
from .series import Gaps


class Feed:
    """Takes messages one by one and shows them at each `flush`.

    `layouts`: fixed layouts by topic; `state_topic` and `read_state`: the topic of the machine's states and its
    decoder. Messages of another layout are left out and counted in `refused`.
    """

    def __init__(
        self, scene: Scene, layouts: Mapping[str, Layout], state_topic: str, read_state: Callable[[bytes], StateSample]
    ):
        self._scene, self._layouts = scene, layouts
        self._state_topic, self._read_state = state_topic, read_state
        self._waiting: dict[str, list[bytes]] = {topic: [] for topic in layouts}
        self._states: list[bytes] = []
        self._gaps = {topic: Gaps() for topic in layouts}
        self.refused = 0
        #: Time of the last output shown, in s; 0 before the first one.
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
        """Shows the buffered messages, with gaps where messages are missing."""
        values: dict[str, tuple[Array, dict[str, Array]]] = {}
        for topic, waiting in self._waiting.items():
            if not waiting:
                continue
            rows = self._layouts[topic].stack(waiting)
            waiting.clear()
            t_s = stamps_s(rows)
            self.now_s = max(self.now_s, float(t_s[-1]))
            columns = {name: rows[name] for name in rows.dtype.names or ()}
            values[topic] = self._gaps[topic].insert(t_s, columns.get("tick", t_s), columns, "health")
        self._scene.show(values, [self._read_state(data) for data in self._states])
        self._states.clear()
