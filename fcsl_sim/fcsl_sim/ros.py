# SPDX-License-Identifier: Apache-2.0
"""Plant truth as standard ROS 2 messages: the `ros` list of a `*.sim.json`.

    "ros": [{"output": "lander.outputs.pos_z", "type": "nav_msgs/Odometry", "field": "pose.pose.position.z", "topic": "odom"}]

The keys beside `output` are those of a machine's `channels[].ros`, but here `topic` is required. Outputs that name the same
topic are parts of one message.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fcsl_compiler.config_channels import read_ros
from fcsl_compiler.config_reader import ConfigReader
from fcsl_compiler.diagnostics import nearest
from fcsl_compiler.json_source import JsonNode
from fcsl_compiler.machine import RosMapping
from fcsl_compiler.source import Span
from fcsl_compiler.standard_messages import STANDARD, SUPPORTED, full_name, short_name
from fcsl_compiler.types import count_of, scalar_of
from simclient.errors import MapError
from simclient.ros_composer import Composer, Source

from .models import ModelField

#: Finds the output that a node names; None when it was reported.
FindOutput = Callable[[JsonNode, str], ModelField | None]


@dataclass(frozen=True)
class TruthTopic:
    """A topic of truth: `type` is the full name of its message; `sources` fill it from the structs of `instances`, which are
    their memories in this order."""

    name: str
    type: str
    frame: str
    child_frame: str
    instances: tuple[str, ...]
    sources: tuple[Source, ...]

    def composer(self) -> Composer:
        """Makes the message out of the structs of `instances`. Raises MapError."""
        return Composer(STANDARD, self.type, self.sources, self.frame, self.child_frame)


@dataclass(frozen=True)
class _Item:
    """An output and what it is mapped onto."""

    output: str
    field: ModelField
    ros: RosMapping
    span: Span


def read_truth(node: JsonNode | None, reader: ConfigReader, find: FindOutput) -> tuple[TruthTopic, ...]:
    """The topics in the order of the list. What is wrong goes to the reader's sink."""
    groups: dict[str, list[_Item]] = {}
    for entry in reader.list(node, "`ros`"):
        item = _read_item(entry, reader, find)
        if item is not None and _fits(item, reader):
            groups.setdefault(item.ros.topic, []).append(item)
    return tuple(_topic(name, items) for name, items in groups.items() if _agree(items, reader))


def _read_item(node: JsonNode, reader: ConfigReader, find: FindOutput) -> _Item | None:
    required, optional = ("output", "type", "field", "topic"), ("frame", "child_frame", "axes")
    keys = reader.object(node, "a mapping of truth", required, optional)
    if keys is None or any(key not in keys for key in required):
        return None
    text = reader.string(keys["output"], "`output`", "instance.outputs.field")
    field = find(keys["output"], text) if text is not None else None
    members = {key: member for key, member in node.members.items() if key in (*required[1:], *optional)}
    ros = read_ros(JsonNode(node.kind, node.span, members), "", reader)
    if text is None or field is None or ros is None:
        return None
    return _Item(text, field, ros, keys["output"].span)


def _fits(item: _Item, reader: ConfigReader) -> bool:
    """Whether the message has such a field for such a value."""
    ros = item.ros
    if full_name(ros.type) not in SUPPORTED:
        names = [short_name(name) for name in SUPPORTED]
        hint = nearest(ros.type, names) or f"there are {', '.join(names)}"
        reader.sink.error("E807", f"truth cannot be mapped onto `{ros.type}`", ros.spans["type"], help=hint)
        return False
    return _composes([item], reader, ros.spans["field"])


def _agree(items: Sequence[_Item], reader: ConfigReader) -> bool:
    """Whether outputs of one topic make one message."""
    first, *others = items
    for item in others:
        for key in ("type", "frame", "child_frame"):
            if getattr(item.ros, key) != getattr(first.ros, key):
                message = f"`{item.output}` and `{first.output}` share topic `{first.ros.topic}`, but not `{key}`"
                span = item.ros.spans.get(key, item.span)
                notes = [(first.ros.spans.get(key, first.span), "the first one")]
                fix = f"write the same `{key}`, or another topic"
                reader.sink.error("E807", message, span, help=fix, notes=notes)
                return False
    for count in range(2, len(items) + 1):
        if not _composes(items[:count], reader, items[count - 1].ros.spans["field"]):
            return False
    return True


def _composes(items: Sequence[_Item], reader: ConfigReader, at: Span) -> bool:
    try:
        _topic(items[0].ros.topic, items).composer()
    except MapError as error:
        reader.sink.error("E807", str(error), at)
        return False
    return True


def _topic(name: str, items: Sequence[_Item]) -> TruthTopic:
    instances = tuple(dict.fromkeys(item.output.partition(".")[0] for item in items))
    sources = tuple(
        Source(
            item.ros.field,
            scalar_of(item.field.type).name,
            count_of(item.field.type),
            item.field.offset,
            axes=item.ros.axes,
            memory=instances.index(item.output.partition(".")[0]),
            name=item.output,
        )
        for item in items
    )
    ros = items[0].ros
    return TruthTopic(name, full_name(ros.type), ros.frame, ros.child_frame, instances, sources)
