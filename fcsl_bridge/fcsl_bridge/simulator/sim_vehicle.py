# SPDX-License-Identifier: Apache-2.0
"""One vehicle of a simulation: its plant, the address at which its controller finds it, its topics."""

from __future__ import annotations

from rclpy.node import Node

from fcsl_sim.config import SimConfig
from fcsl_sim.native import Simulation

from ..base.bus_address import peer_address
from ..topics.queue_publisher import QueuePublisher
from ..topics.tf import Chosen
from .sim_topics import SimTopics


class Vehicle:
    """name_space: of its topics, empty for the node's own. endpoint: where its controller finds it; `is_client` of the bus
    there, where another vehicle listens."""

    def __init__(
        self,
        node: Node,
        config: SimConfig,
        name_space: str,
        decimate: int,
        chosen: Chosen,
        endpoint: str,
        is_client: bool,
        timeout_s: float,
        queue_publisher: QueuePublisher,
    ):
        self.name_space = name_space
        self._config, self._timeout_ms = config, int(1000 * timeout_s)
        inside = node.get_namespace()
        self._keys = name_space if name_space.startswith("/") else f"{inside}/{name_space}"
        self._address = peer_address(endpoint, self._keys, is_client)
        self.accepted = False
        self.sim = Simulation(config.plan, config.tables)
        self.topics = SimTopics(node, self.sim, config.ros, name_space, decimate, chosen, queue_publisher)

    def listen(self) -> None:
        """A controller can connect from now on. Raises SimError."""
        self.sim.listen(self._address, self._timeout_ms, self._keys)
        self.accepted = False

    def accept(self, wait_ms: int) -> None:
        """Waits for the controller, for up to wait_ms; sets `accepted`. Raises SimError."""
        self.accepted = self.sim.accept(wait_ms)

    @property
    def running(self) -> bool:
        return self.sim.status == "running"

    def reset(self) -> None:
        """Back to tick 0, in a new run; nobody is connected."""
        self.sim.close()
        self.sim = Simulation(self._config.plan, self._config.tables)

    def close(self) -> None:
        self.sim.close()
