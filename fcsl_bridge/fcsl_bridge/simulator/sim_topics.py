# SPDX-License-Identifier: Apache-2.0
"""The topics of one vehicle at t_k, below the vehicle's namespace:

    sim/truth       fcsl_msgs/PlantTruth     outputs of the plant's models, each n-th tick
    truth topics    standard messages        those of the simulation's `ros` list, each n-th tick
    /tf             tf2_msgs/TFMessage       poses of truth topics, of those that are chosen
    sensor topics   standard messages        the machine's mapped sensor channels, when the simulation samples one of them

The simulation composes the messages in each tick, and puts them into the publish queue.
"""

from __future__ import annotations

from rclpy.node import Node
from rclpy.serialization import serialize_message

from fcsl_msgs.msg import PlantTruth
from fcsl_sim.native import Simulation
from fcsl_sim.ros import TruthTopic
from simclient.ros.topics import composer_of, topics_of

from ..topics import qos, tf
from ..topics.interfaces import mapped_class, message_class
from ..topics.queue_publisher import QueuePublisher


def below(name_space: str, topic: str) -> str:
    """`topic` in a vehicle's namespace; an absolute one stays."""
    return f"{name_space}/{topic}" if name_space and not topic.startswith("/") else topic


def _head(names: list[str]) -> bytes:
    """PlantTruth as CDR up to the first value."""
    data = serialize_message(PlantTruth(name=names, value=[0.0] * len(names)))
    return data[: len(data) - 8 * len(names)]


class SimTopics:
    """The publishers of a vehicle. `decimate` n: truth is published at each n-th tick. `chosen`: what goes to /tf, too."""

    def __init__(
        self,
        node: Node,
        sim: Simulation,
        truth: tuple[TruthTopic, ...],
        name_space: str,
        decimate: int,
        chosen: tf.Chosen,
        queue_publisher: QueuePublisher,
    ):
        self._decimate, self._queue = decimate, queue_publisher.queue
        self.plant_publisher = qos.publisher(node, PlantTruth, below(name_space, "sim/truth"), qos.STREAM)
        self._plant = queue_publisher.add(self.plant_publisher)
        self._truth = []
        for topic in truth:
            publisher = qos.publisher(node, message_class(topic.type), below(name_space, topic.name), qos.STREAM)
            self._truth.append((queue_publisher.add(publisher), topic.composer(), topic.instances))
        posed = [tf.Posed(t.name, t.type, t.frame, t.child_frame, t.sources) for t in truth]
        transforms = tf.broadcasts(chosen.topics, posed)
        if transforms:
            publisher = qos.publisher(node, message_class(tf.MESSAGE), chosen.tf_topic, qos.TF)
            instances = {topic.name: topic.instances for topic in truth}
            self._truth += [(queue_publisher.add(publisher), c, instances[name]) for name, c in transforms.items()]
        self._sensors = []
        for mapped in topics_of(sim.machine):
            if mapped.direction == "sensor":
                kind = mapped_class(mapped.type, mapped.type_hash)
                publisher = qos.publisher(node, kind, below(name_space, mapped.name), qos.STREAM)
                channels = [channel.index for channel in mapped.channels]
                self._sensors.append((queue_publisher.add(publisher), composer_of(mapped), channels))

    def show(self, sim: Simulation) -> None:
        """Makes the simulation, which has made no tick, put the messages of each tick into the publish queue. Keep this object as long
        as it does."""
        for number, composer, channels in self._sensors:
            sim.show_channels(self._queue, number, composer, channels)
        sim.show_truth(self._queue, self._plant, _head(sim.truth_names()), self._decimate)
        for number, composer, instances in self._truth:
            sim.show_instances(self._queue, number, composer, instances, self._decimate)
