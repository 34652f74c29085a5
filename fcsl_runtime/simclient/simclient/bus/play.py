# SPDX-License-Identifier: Apache-2.0
"""Plays a bag's sensors to a flight computer, and compares what it answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from .bag_ticks import BagTick, BagTicks
from .controller import KEEP_ALIVE_S, Controller, RunEnded


@dataclass
class Played:
    """`compared` ticks have values of actuators in the bag; `differ` of them came out otherwise, the first one as `first`
    says."""

    ticks: int = 0
    begins: int = 0  # tick of the bag that was played as tick 0
    missing: int = 0  # of which the bag has nothing
    compared: int = 0
    differ: int = 0
    first: str = ""
    ended: str = ""

    def __str__(self) -> str:
        lines = [f"{self.ticks} ticks played" + (f": {self.ended}" if self.ended else "")]
        if self.begins:
            lines.append(f"the bag begins at tick {self.begins}, which was played as tick 0")
        if self.missing:
            lines.append(f"{self.missing} of them are not in the bag, and were played without values")
        if self.differ:
            lines += [f"{self.differ} of {self.compared} ticks were answered otherwise", f"first: {self.first}"]
        elif self.compared:
            lines.append(f"{self.compared} ticks were answered as in the bag, bit for bit")
        else:
            lines.append("the bag has no actuators to compare")
        return "\n".join(lines)


class Player:
    """`speed` 0: as fast as it goes."""

    def __init__(self, ticks: BagTicks, controller: Controller, speed: float, stopped: Callable[[], bool]):
        self.played = Played()
        self._ticks, self._controller, self._speed, self._stopped = ticks, controller, speed, stopped

    def play(self) -> Played:
        """From the first tick to the last, or until it is stopped. Raises BagError, BusError."""
        played, begun_s = self.played, 0.0
        for tick in self._ticks.ticks():
            if played.ticks == 0:
                played.begins, begun_s = tick.tick, time.monotonic()
            if not self._is_time(begun_s + played.ticks / self._ticks.machine.tick_hz / (self._speed or 1.0)):
                played.ended = "interrupted"
                break
            try:
                answer = self._controller.step(played.ticks, tick.sensors)
            except RunEnded:
                played.ended = "the flight computer ended the run"
                break
            played.ticks += 1
            played.missing += not tick.sensors and not tick.actuators
            self._compare(tick, answer)
        played.ended = played.ended or self._ticks.stop
        return played

    def _is_time(self, when_s: float) -> bool:
        """Waits until then, if it keeps to a time; false once it is stopped."""
        while self._speed and not self._stopped() and (left_s := when_s - time.monotonic()) > 0:
            time.sleep(min(left_s, KEEP_ALIVE_S))
            if left_s > KEEP_ALIVE_S:
                self._controller.keep_alive()
        return not self._stopped()

    def _compare(self, tick: BagTick, answer: dict[str, bytes]) -> None:
        if not tick.actuators:
            return
        self.played.compared += 1
        for channel in self._ticks.machine.channels:
            was, now = tick.actuators.get(channel.name), answer.get(channel.name)
            if was is not None and was != now:
                self.played.differ += 1
                if not self.played.first:
                    came = "nothing" if now is None else channel.decode(now)
                    self.played.first = (
                        f"tick {tick.tick}, {channel.name}: {channel.decode(was)} in the bag, {came} now"
                    )
                return
