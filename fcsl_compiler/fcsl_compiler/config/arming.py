# SPDX-License-Identifier: Apache-2.0
"""What arms the actuators, how long they wait for a command, and what they get otherwise (docs/hardware/arming.md)."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.machine import Channel, Machine, PortRef, Values, seconds
from ..model.types import BOOL, Struct, Type
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from ..parse.json_values import example
from .ports import PortResolver

#: Longest time without a command. The slowest machine has one tick in a second, so it misses 60 of them.
MAX_TIMEOUT_S = 60
_NS = 1_000_000_000


def read_arming(
    keys: dict[str, JsonNode], tick_hz: int, ports: PortResolver, channels: list[Channel], reader: ConfigReader
) -> tuple[PortRef | None, int]:
    """The output that arms (None: nothing does) and the time-out in ns (0: none). Both need actuators that are safe."""
    arm = _arm(keys["arm"], ports, reader) if "arm" in keys else None
    timeout_ns = _timeout(keys["command_timeout_s"], tick_hz, reader) if "command_timeout_s" in keys else 0
    for key in ("arm", "command_timeout_s"):
        if key in keys:
            _check_channels(f"`{key}`", keys[key].span, keys.get("channels"), channels, reader.sink)
            break  # one mistake, one message
    return arm, timeout_ns


def read_safe(node: JsonNode, type_: Type, direction: str, reader: ConfigReader) -> Values | None:
    """The safe value of a channel whose field has this type."""
    if direction != "actuator":
        why = "only an actuator has a value in which it is safe"
        reader.sink.error("E214", "`safe` is for actuators", node.span, why=why, help="remove it")
        return None
    return reader.value(node, type_, "`safe`")


def _arm(node: JsonNode, ports: PortResolver, reader: ConfigReader) -> PortRef | None:
    port = ports.output(node, "`arm` names an output")
    if port is not None and port.type != BOOL:
        fix = f'declare an output `"armed": "bool"` in `{ports.instances[port.instance].algorithm.name}`, and name that'
        notes = [(port.declared, "declared here")] if port.field != "health" else []
        message = f"`arm` names a bool, and `{node.written}` is {port.type}"
        why = "actuators are armed or not"
        reader.sink.error("E248", message, node.span, why=why, help=fix, notes=notes)
        return None
    return port


def _timeout(node: JsonNode, tick_hz: int, reader: ConfigReader) -> int:
    """The time-out in ns, rounded down; 0 after reporting an error."""
    if not node.is_number:
        reader.wrong(node, "`command_timeout_s` is a number", "a time in s, such as 0.1")
        return 0
    if not tick_hz:  # reported earlier
        return 0
    time_ns = Fraction(node.text) * _NS
    tick_ns = -(-_NS // tick_hz)
    if not tick_ns < time_ns <= MAX_TIMEOUT_S * _NS:
        fix = f"it is longer than a tick, {seconds(1, tick_hz)[:12]} s, and at most {MAX_TIMEOUT_S} s"
        why = "one command comes per tick" if 0 < time_ns <= tick_ns else ""
        reader.sink.error("E204", f"`command_timeout_s` is {node.text}", node.span, why=why, help=fix)
        return 0
    return int(time_ns)


def _check_channels(what: str, at: Span, node: JsonNode | None, channels: list[Channel], sink: DiagnosticSink) -> None:
    """Reports a machine without actuators, and all actuators without `safe`; of those that were read, with a value."""
    items = node.items if node is not None and node.kind == "array" else []
    directions = [direction.value if (direction := item.get("direction")) else None for item in items]
    if all(direction in ("sensor", "report") for direction in directions) and (node is None or node.kind == "array"):
        message, fix = f"{what} in a machine without actuators", "remove it, or add a channel that is an actuator"
        sink.error("E214", message, at, why="there is nothing to keep safe", help=fix)
    spans = [i.span for i, d in zip(items, directions, strict=True) if d == "actuator" and i.get("safe") is None]
    lacking = [c for c in channels if c.span in spans]
    if not lacking:
        return
    names = ", ".join(f"`{c.name}`" for c in lacking)
    message = f"{what} needs safe values, and {names} {'has' if len(lacking) == 1 else 'have'} none"
    fixes = [f'`"safe": {_example(c.port)}`' + (f" to `{c.name}`" if len(lacking) > 1 else "") for c in lacking[:2]]
    fix = f"add {', '.join(fixes)}{', …' if len(lacking) > 2 else ''}"
    why = "while they are disarmed or no command comes, actuators get their safe values"
    sink.error("E249", message, at, why=why, help=fix, notes=[(c.span, "it has no `safe`") for c in lacking])


def _example(port: PortRef) -> str:
    assert not isinstance(port.type, Struct)  # a channel carries none
    return example(port.type)


def subset_arm(arm: PortRef | None, new: dict[int, int]) -> PortRef | None:
    """The output that arms in a subset machine; `new`: the numbers of the instances that stay, by their old ones."""
    return replace(arm, instance=new[arm.instance]) if arm is not None and arm.instance in new else None


def warn_old_arm(machine: Machine, sink: DiagnosticSink) -> None:
    """Warns about states that do not run the instance that arms. If none does, W204 is reported."""
    if machine.arm is None:
        return
    index = machine.arm.instance
    without = [s for s in machine.states if all(e.instance != index for e in s.entries)]
    if not without or len(without) == len(machine.states):
        return
    name = machine.instances[index].name
    states = ", ".join(f"`{s.name}`" for s in without)
    sink.warning(
        "W212",
        f"`{name}` arms the actuators and does not run in {states}",
        machine.arm.span,
        why="its output keeps what another state left, so they stay armed or disarmed",
        help=f"schedule `{name}` in every state, or name an output of an instance that runs in all",
        notes=[(s.span, "does not schedule it") for s in without],
    )
