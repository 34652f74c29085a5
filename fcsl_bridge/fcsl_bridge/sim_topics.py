# SPDX-License-Identifier: Apache-2.0
"""The topics of one vehicle at t_k, below the vehicle's namespace:

    sim/truth       fcsl_msgs/PlantTruth     outputs of the plant's models, each n-th tick
    truth topics    standard messages        those of the simulation's `ros` list, each n-th tick
    sensor topics   standard messages        the machine's mapped sensor channels, when the simulation samples one of them

Messages are composed natively, or in advance: names do not change during a run.
"""

from __future__ import annotations

import struct

from rclpy.node import Node
from rclpy.serialization import serialize_message

from fcsl_msgs.msg import PlantTruth
from fcsl_sim.native import Simulation
from fcsl_sim.ros import TruthTopic
from simclient.ros.topics import RosTopic, composer_of, topics_of

from . import qos
from .interfaces import message_class

_STAMP = struct.Struct("<iI")
_TICK = struct.Struct("<Q")
#: CDR of a header with an empty frame_id: encapsulation, stamp, length 1 and a NUL; the next member is aligned to 8.
_STAMP_AT, _TICK_AT = 4, 20
_NS = 1_000_000_000


def below(name_space: str, topic: str) -> str:
    """`topic` in a vehicle's namespace; an absolute one stays."""
    return f"{name_space}/{topic}" if name_space and not topic.startswith("/") else topic


class TruthMessage:
    """PlantTruth as CDR; only stamp, tick and values change."""

    def __init__(self, sim: Simulation):
        names = sim.truth_names()
        data = serialize_message(PlantTruth(name=names, value=[0.0] * len(names)))
        self._head = bytearray(data[: len(data) - 8 * len(names)])

    def compose(self, sim: Simulation, tick: int, time_ns: int) -> bytes:
        _STAMP.pack_into(self._head, _STAMP_AT, *divmod(time_ns, _NS))
        _TICK.pack_into(self._head, _TICK_AT, tick)
        return bytes(self._head) + sim.truth_values()


class SimTopics:
    """`decimate` n: truth is published at each n-th tick."""

    def __init__(self, node: Node, sim: Simulation, truth: tuple[TruthTopic, ...], name_space: str, decimate: int):
        self._decimate = decimate
        self._plant = TruthMessage(sim)
        self.plant_publisher = qos.publisher(node, PlantTruth, below(name_space, "sim/truth"), qos.STREAM)
        self._truth = [_Truth(node, topic, name_space) for topic in truth]
        sensors = [topic for topic in topics_of(sim.machine) if topic.direction == "sensor"]
        self._sensors = [_Sensor(node, topic, name_space) for topic in sensors]

    def publish(self, sim: Simulation, time_ns: int) -> None:
        """Publishes the values at the last sensed tick."""
        tick = sim.tick
        for sensor in self._sensors:
            sensor.publish(sim, time_ns)
        if tick % self._decimate == 0:
            self.plant_publisher.publish(self._plant.compose(sim, tick, time_ns))
            for topic in self._truth:
                topic.publish(sim, time_ns)


class _Truth:
    def __init__(self, node: Node, topic: TruthTopic, name_space: str):
        self._composer = topic.composer()
        self._instances = topic.instances
        self.publisher = qos.publisher(node, message_class(topic.type), below(name_space, topic.name), qos.STREAM)

    def publish(self, sim: Simulation, time_ns: int) -> None:
        data = self._composer.compose([sim.instance_data(name) for name in self._instances], time_ns)
        if data is not None:
            self.publisher.publish(data)


class _Sensor:
    def __init__(self, node: Node, topic: RosTopic, name_space: str):
        self._composer = composer_of(topic)
        self._channels = [channel.index for channel in topic.channels]
        self._publisher = qos.publisher(node, message_class(topic.type), below(name_space, topic.name), qos.STREAM)

    def publish(self, sim: Simulation, time_ns: int) -> None:
        """Publishes only if one of its channels was sampled; the others then have their last samples."""
        if any(sim.sampled(channel) for channel in self._channels):
            data = self._composer.compose([sim.channel_data()], time_ns)
            if data is not None:
                self._publisher.publish(data)
