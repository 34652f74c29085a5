# SPDX-License-Identifier: Apache-2.0
"""One vehicle of a simulation: its plant, its controller at the other end of the lock-step, its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rclpy.node import Node

from fcsl_sim.config import SimConfig
from fcsl_sim.native import Simulation

from .errors import BridgeError
from .lockstep import SimulatorEnd
from .sim_topics import SimTopics


class Vehicle:
    """name_space: namespace of its topics, empty for the node's own. `serve` runs while waiting for its controller."""

    def __init__(self, node: Node, config: SimConfig, name_space: str, decimate: int, serve: Callable[[], None]):
        self._config, self._name_space = config, name_space
        self.sim = Simulation(config.plan, config.tables)
        self.topics = SimTopics(node, self.sim, config.ros, name_space, decimate)
        self._end = SimulatorEnd(node, self.sim.machine, serve, name_space)
        self._asked = self._awaited = False  # a tick was sent; take_answer() waits for its answer

    @property
    def running(self) -> bool:
        return self.sim.status == "running"

    @property
    def dropped(self) -> int:
        """Repeated bundles."""
        return self._end.dropped

    def send(self) -> None:
        """Advances to the next tick and sends its sensors."""
        tick = self.sim.tick
        self._end.send(tick, self.sim.sense())
        self._asked = True

    def take_answer(self, timeout_s: float) -> None:
        """Completes the tick that was sent; after the last one sends END to the controller. Raises BridgeError."""
        self._awaited = True
        with self._named():
            frame = self._end.answer(timeout_s)
        self._asked = self._awaited = False
        self.sim.actuate(frame)
        if not self.running:
            self._end.end(self.sim.tick)

    def say_alive(self) -> None:
        """Keeps a controller without a tick to answer waiting; call it often while no tick is sent, or while waiting
        for others. Raises BridgeError."""
        if not self.running or self._awaited:
            return
        with self._named():
            if self._asked:
                self._end.alive_if_answered()
            else:
                self._end.alive(self.sim.tick)

    def leave(self) -> None:
        """Sends END to the controller: no further tick follows the last sent one."""
        if self.running:
            self._end.leave(self.sim.tick + 1)

    def reset(self) -> None:
        """Back to tick 0, in a new run."""
        self.sim.close()
        self.sim = Simulation(self._config.plan, self._config.tables)
        self._end.reset()
        self._asked = self._awaited = False

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Prefixes errors with the vehicle's namespace."""
        try:
            yield
        except BridgeError as error:
            raise (type(error)(f"{self._name_space}: {error}") if self._name_space else error) from None

    def close(self) -> None:
        self.sim.close()
