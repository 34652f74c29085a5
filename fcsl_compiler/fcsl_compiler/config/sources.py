# SPDX-License-Identifier: Apache-2.0
"""Sources of connections other than outputs: `machine.<name>`, and `channels.<channel>.<name>` for sensor channels."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink, nearest
from ..model.machine import CHANNEL_SOURCES, MACHINE_SOURCES, PortRef
from ..parse.json_source import JsonNode

#: First parts of such paths. They are not names of instances.
OWNERS = ("machine", "channels")


class SourceResolver:
    """Resolves such sources. Methods return None after reporting an error.

    `channels`: those of the machine JSON. Only their names and directions are read here.
    """

    def __init__(self, channels: JsonNode | None, sink: DiagnosticSink):
        self.sink = sink
        items = channels.items if channels is not None and channels.kind == "array" else []
        self._directions = {_text(item, "name"): _text(item, "direction") for item in items}
        self._readable = "" not in self._directions and (channels is None or channels.kind == "array")

    def find(self, text: str, node: JsonNode) -> PortRef | None:
        """Resolves `text`, which begins with one of OWNERS."""
        owner, _, rest = text.partition(".")
        return self._of_machine(rest, node) if owner == "machine" else self._of_channel(rest, node)

    def _of_machine(self, name: str, node: JsonNode) -> PortRef | None:
        if name in MACHINE_SOURCES:
            type_, unit = MACHINE_SOURCES[name]
            return PortRef(-1, "machine", name, type_, unit, node.span, node.span)
        fix = f"there are {', '.join('machine.' + n for n in MACHINE_SOURCES)}"
        self.sink.error(
            "E206", f"no source `{node.value}`", node.span, help=nearest(name, list(MACHINE_SOURCES)) or fix
        )
        return None

    def _of_channel(self, rest: str, node: JsonNode) -> PortRef | None:
        """Resolves `channels.<channel>.<name>`. The name of a channel may contain dots."""
        channel, _, name = rest.rpartition(".")
        if name in CHANNEL_SOURCES and channel in self._directions:
            return self._of_known(channel, name, node)
        if rest in self._directions or channel in self._directions:
            known = rest if rest in self._directions else channel
            fix = f"there are {', '.join(f'channels.{known}.{n}' for n in CHANNEL_SOURCES)}"
            hint = nearest(name, list(CHANNEL_SOURCES)) if known == channel else ""
            self.sink.error("E206", f"no source `{node.value}`", node.span, help=hint or fix)
        elif self._readable:
            sensors = [n for n, direction in self._directions.items() if direction == "sensor"]
            named = channel if name in CHANNEL_SOURCES else rest
            fix = f"the sensors are {', '.join(sensors)}" if sensors else "the machine has no sensor"
            message = f"no channel `{named}`" if named else "`channels` names no channel"
            self.sink.error("E206", message, node.span, help=nearest(named, sensors) or fix)
        return None

    def _of_known(self, channel: str, name: str, node: JsonNode) -> PortRef | None:
        direction = self._directions[channel]
        if direction in ("actuator", "report"):
            what = "an actuator" if direction == "actuator" else "a report"
            message = f"channel `{channel}` is {what}: it has no samples"
            fix = f"only a sensor has `{name}`; connect from the output that the channel sends"
            self.sink.error("E215", message, node.span, help=fix)
        if direction != "sensor":
            return None
        return PortRef(-1, "channels", channel, CHANNEL_SOURCES[name], "", node.span, node.span, (name,))


def _text(item: JsonNode, key: str) -> str:
    """A string member; "" if it is missing or not a string, which channels.py reports."""
    node = item.get(key)
    return str(node.value) if node is not None and node.kind == "string" else ""
