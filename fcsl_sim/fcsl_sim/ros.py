# SPDX-License-Identifier: Apache-2.0
"""Plant truth as ROS 2 messages: the `ros` list of a `*.sim.json`.

    "ros": [{"output": "lander.outputs.pos_z", "type": "nav_msgs/Odometry", "field": "pose.pose.position.z", "topic": "odom"}]

The keys are those of a machine's `channels[].ros`, plus `output`; `topic` is required here. Outputs with the same topic
are parts of one message.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fcsl_compiler.api.json_files import ConfigReader, JsonNode
from fcsl_compiler.api.ros import Definitions, Source, full_name, interfaces_of, resolve_choices
from fcsl_compiler.api.sections import Mapped, check_mapped, read_ros
from fcsl_compiler.api.types import count_of, scalar_of
from simclient.ros.composer import Composer

from .models import ModelField

#: Finds the output that a node names; None if an error was reported.
FindOutput = Callable[[JsonNode, str], ModelField | None]
#: An output and its mapping onto a message, in the form of an actuator channel's.
_Item = tuple[Mapped, ModelField]


@dataclass(frozen=True)
class TruthTopic:
    """A truth topic: `type` is the full name of its message.

    `sources` map memories to the message's fields; memory i is the struct of `instances[i]`.
    """

    name: str
    type: str
    frame: str
    child_frame: str
    instances: tuple[str, ...]
    sources: tuple[Source, ...]
    definitions: Definitions

    def composer(self) -> Composer:
        """A composer of the message from the structs of `instances`. Raises MapError."""
        return Composer(self.definitions, self.type, self.sources, self.frame, self.child_frame)


def read_truth(node: JsonNode | None, reader: ConfigReader, find: FindOutput) -> tuple[TruthTopic, ...]:
    """The topics in list order. Errors go to the reader's sink; then the result is empty."""
    items = []
    for entry in reader.list(node, "`ros`"):
        item = _read_item(entry, reader, find)
        if item is not None:
            items.append(item)
    check_mapped([mapped for mapped, _ in items], reader.sink)
    if reader.sink.failed:
        return ()
    groups: dict[str, list[_Item]] = {}
    for mapped, field in items:
        groups.setdefault(mapped.ros.topic, []).append((mapped, field))
    return tuple(_topic(name, items) for name, items in groups.items())


def _read_item(node: JsonNode, reader: ConfigReader, find: FindOutput) -> _Item | None:
    required, optional = ("output", "type", "field", "topic"), ("frame", "child_frame", "axes", "choices")
    keys = reader.object(node, "a mapping of truth", required, optional)
    if keys is None or any(key not in keys for key in required):
        return None
    text = reader.string(keys["output"], "`output`", "instance.outputs.field")
    field = find(keys["output"], text) if text is not None else None
    members = {key: member for key, member in node.members.items() if key != "output" and key in keys}
    ros = read_ros(JsonNode(node.kind, node.span, members), "", reader)
    if text is None or field is None or ros is None:
        return None
    return Mapped(text, "actuator", ros, field.type, field.unit, keys["output"].span), field


def _topic(name: str, items: Sequence[_Item]) -> TruthTopic:
    instances = tuple(dict.fromkeys(mapped.name.partition(".")[0] for mapped, _ in items))
    ros = items[0][0].ros
    found, message = interfaces_of(ros), full_name(ros.type)
    sources = tuple(
        Source(
            mapped.ros.field,
            scalar_of(field.type).name,
            count_of(field.type),
            field.offset,
            axes=mapped.ros.axes,
            memory=instances.index(mapped.name.partition(".")[0]),
            name=mapped.name,
            choices=resolve_choices(found, message, mapped.ros.field, mapped.ros.choices),
        )
        for mapped, field in items
    )
    return TruthTopic(name, message, ros.frame, ros.child_frame, instances, sources, found.members)
