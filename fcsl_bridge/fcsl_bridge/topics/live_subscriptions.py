# SPDX-License-Identifier: Apache-2.0
"""A machine's topics as raw bytes with the layout of their messages, for live views."""

from __future__ import annotations

import re
from collections.abc import Iterator

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fcsl_msgs.msg import MachineState, PlantTruth
from simclient.bag.states import StateSample
from simclient.descriptor import Machine
from simclient.ros.cdr import Layout, Leaf, fixed_layout
from simclient.view.signals import Signals, signals_of

from ..base.polling import PolledSubscription
from ..errors import BridgeError
from . import qos
from .interfaces import instance_class

#: Head of fcsl_msgs messages: encapsulation, stamp, empty frame_id, tick.
_TICK_AT, _TICK_BYTES = 20, 8
#: DDS pads messages to whole words.
_PADDING = 3
_NS = 1_000_000_000
_TRUTH_NAME = re.compile(r"(?P<instance>[^.]+)\.outputs\.(?P<field>.+?)(\[\d+\])?")


class LiveSubscriptions:
    """Subscriptions to outputs, states and plant truth of `machine`, below the node's namespace.

    `layouts` and `signals` describe the messages of `drain`. The plant's are known after its first message, which is
    dropped.
    """

    def __init__(self, node: Node, machine: Machine):
        self.layouts: dict[str, Layout] = {}
        self.signals: list[Signals] = []
        self._outputs: list[PolledSubscription] = []
        for instance in machine.instances:
            if instance.published:
                kind, topic = instance_class(instance), f"{machine.name}/{instance.topic}"
                polled = PolledSubscription(node, kind, topic, qos.STREAM)
                self._describe(polled.topic, instance.name, instance.message_type, instance.message_text)
                self._outputs.append(polled)
        self._state = PolledSubscription(node, MachineState, f"{machine.name}/state", qos.LATCHED_HISTORY)
        self._truth = PolledSubscription(node, PlantTruth, "sim/truth", qos.STREAM)
        self.prefix = self.state_topic.rpartition("/")[0]
        self._plant: list[str] = []

    def _describe(self, topic: str, name: str, message_type: str, text: str) -> None:
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register(get_types_from_msg(text, message_type))
        layout = fixed_layout(store.fielddefs, message_type)
        if layout is None:
            raise BridgeError(f"message {message_type} of instance `{name}` has no fixed layout")
        self.layouts[topic] = layout
        self.signals.append(signals_of(name, topic, False, layout, text))

    @property
    def state_topic(self) -> str:
        return self._state.topic

    @property
    def plant_is_known(self) -> bool:
        return bool(self._plant)

    def drain(self) -> Iterator[tuple[str, bytes]]:
        """(topic, CDR) of all received messages; the plant's truth once per instance."""
        for polled in self._outputs:
            size = self.layouts[polled.topic].size
            while (data := polled.take()) is not None:
                yield polled.topic, data[:size] if 0 <= len(data) - size <= _PADDING else data
        while (data := self._truth.take()) is not None:
            if not self._plant:
                self._meet_plant(data)
            for topic in self._plant:
                yield topic, data
        while (data := self._state.take()) is not None:
            yield self.state_topic, data

    def _meet_plant(self, data: bytes) -> None:
        """Derives the plant's signals from a message; its names and layout do not change later."""
        layouts = truth_layouts(list(deserialize_message(data, PlantTruth).name), len(data))
        for instance, layout in layouts.items():
            topic = f"{self._truth.topic.rpartition('/')[0]}/{instance}"
            self.layouts[topic] = layout
            self.signals.insert(len(self._plant), signals_of(instance, topic, True, layout, ""))
            self._plant.append(topic)


def truth_layouts(names: list[str], size: int) -> dict[str, Layout]:
    """The layout of each plant instance's values, which are the last part of a PlantTruth message of `size` bytes."""
    value_bytes = 8
    begin = size - value_bytes * len(names)
    fields: dict[str, dict[str, list[int]]] = {}
    for number, name in enumerate(names):
        parsed = _TRUTH_NAME.fullmatch(name)
        if parsed:
            places = fields.setdefault(parsed["instance"], {}).setdefault(parsed["field"], [])
            places.append(begin + value_bytes * number)
    stamp = [Leaf("header.stamp.sec", "int32", 0, 4), Leaf("header.stamp.nanosec", "uint32", 0, 8)]
    layouts = {}
    for instance, its_fields in fields.items():
        single = {name for name in names if name.startswith(f"{instance}.outputs.") and not name.endswith("]")}
        leaves = [
            Leaf(field, "float64", 0 if f"{instance}.outputs.{field}" in single else len(places), places[0])
            for field, places in its_fields.items()
        ]
        layouts[instance] = Layout([*stamp, *leaves], (), size)
    return layouts


def tick_of(data: bytes) -> int:
    """The tick of any message of a machine or its plant."""
    return int.from_bytes(data[_TICK_AT : _TICK_AT + _TICK_BYTES], "little")


def read_state(data: bytes) -> StateSample:
    """A MachineState message."""
    message = deserialize_message(data, MachineState)
    stamp = message.header.stamp
    return StateSample(message.tick, stamp.sec * _NS + stamp.nanosec, message.state, message.next_state)
