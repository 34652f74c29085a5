# SPDX-License-Identifier: Apache-2.0
"""Channels of the machine JSON. All transports derive from this table."""

from __future__ import annotations

import re

from ..base.source import MAX_NAME, Span
from ..model import ir
from ..model.machine import NOT_MAPPED, Channel, Connection, PortRef, RosMapping, Values
from ..model.types import F32, F64, HEALTH, REQUEST, U32, Array, Scalar, Type, count_of, element_of, scalar_of
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .arming import read_safe
from .ports import PortResolver
from .ros import check_channels, find_message
from .services import check_service_channel, check_service_names, read_service
from .times import read_ticks

_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*")
_ROS_TYPE = re.compile(r"[a-z][a-z0-9_]*/[A-Z][A-Za-z0-9]*")
_ROS_NAME = r"[a-z](_?[a-z0-9])*"
_ROS_STEP = rf"{_ROS_NAME}(\[[^\s\[\]]+\])?"
_ROS_FIELD = re.compile(rf"\.|{_ROS_STEP}(\.{_ROS_STEP})*")
_ROS_TOPIC = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
_ROS_FRAME = re.compile(r"\S+")
#: Axes of a vector; and of a rotation: target axes, source axes.
AXES = ("enu", "ned", "flu", "frd", "enu/flu", "ned/frd", "ned/flu", "enu/frd")
_MAX_AGE = 2**32 - 2
#: Of the field of a channel: an entry counts its values in 16 bits (docs/reference/transports.md), and hosts refuse a longer field.
_MAX_BYTES = 2**16 - 1
#: A sensor writes a field, an actuator reads one. A report reads one too, and nothing moves by it.
DIRECTIONS = ("sensor", "actuator", "report")
#: Values as they are, or a ROS 2 message of each channel.
PAYLOADS = ("raw", "cdr")
#: Ids from 0xFF00 on are reserved for entries of messages that are no channels (docs/reference/transports.md).
MAX_ID = 0xFEFF


def read_channels(
    keys: dict[str, JsonNode], tick_hz: int, ports: PortResolver, connections: list[Connection], reader: ConfigReader
) -> list[Channel]:
    """Checked channels in JSON order. Names, ids and bound fields are unique."""
    node = keys.get("channels")
    of_machine = _grace(keys["start_grace_s"], tick_hz, reader) if "start_grace_s" in keys else None
    channels: list[Channel] = []
    names: dict[str, Span] = {}
    ids: dict[int, Span] = {}
    fields: dict[tuple[int, str, str], Span] = {}
    for item in reader.list(node, "`channels`"):
        channel = _channel(item, tick_hz, of_machine, ports, connections, reader)
        if channel is None:
            continue
        field = (channel.port.instance, channel.port.record, channel.port.path)
        firsts = {
            "name": names.setdefault(channel.name, channel.span),
            "id": ids.setdefault(channel.id, channel.span),
            "field": fields.setdefault(field, channel.span),
        }
        for what, first in firsts.items():
            if first is not channel.span:
                message = f"two channels with the same {what}"
                fix = f"give each channel its own {what}" if what != "field" else "a field has one channel; remove one"
                reader.sink.error("E226", message, channel.span, help=fix, notes=[(first, "the other")])
        channels.append(channel)
    check_channels(channels, reader.sink)
    check_service_names(channels, reader.sink)
    return channels


def read_payload(node: JsonNode | None, reader: ConfigReader) -> str:
    """`payload` of `bus`: what lies under a channel's key on the bus."""
    keys = reader.object(node, "`bus`", ("payload",)) if node is not None else None
    return (reader.choice(keys.get("payload"), "`payload`", PAYLOADS) if keys else None) or PAYLOADS[0]


def _grace(node: JsonNode, tick_hz: int, reader: ConfigReader) -> int | None:
    why = "a channel waits for a whole number of ticks"
    return read_ticks(node, "start_grace_s", tick_hz, _MAX_AGE, why, reader, may_be_zero=True)


def _channel(
    item: JsonNode,
    tick_hz: int,
    machine_grace: int | None,
    ports: PortResolver,
    connections: list[Connection],
    reader: ConfigReader,
) -> Channel | None:
    keys = reader.object(
        item, "a channel", ("name", "id", "field", "direction"), ("max_age_ticks", "start_grace_s", "safe", "as", "ros")
    )
    if keys is None:
        return None
    name = reader.string(keys.get("name"), "`name`")
    if name is not None and not (_NAME.fullmatch(name) and len(name) <= MAX_NAME):
        reader.sink.error(
            "E203", f"`{name}` is not a channel name", keys["name"].span, help="lower case, such as imu.gyro"
        )
        name = None
    number = reader.integer(keys.get("id"), "`id`", 0, MAX_ID)
    direction = reader.choice(keys.get("direction"), "`direction`", DIRECTIONS)
    age = reader.integer(keys.get("max_age_ticks"), "`max_age_ticks`", 0, _MAX_AGE)
    for key in ("max_age_ticks", "start_grace_s"):
        if direction in ("actuator", "report") and key in keys:
            reader.sink.error("E214", f"`{key}` is for sensors", keys[key].span, help="remove it")
    grace = machine_grace if machine_grace is not None else age
    if direction == "sensor" and "start_grace_s" in keys:
        grace = _grace(keys["start_grace_s"], tick_hz, reader)
    is_service = "ros" in keys and keys["ros"].get("service") is not None
    ros: RosMapping | None = NOT_MAPPED
    service = None
    if is_service:
        service = read_service(keys["ros"], tick_hz, reader)
    elif "ros" in keys:
        ros = read_ros(keys["ros"], default_topic(name or ""), reader)
    port = _bound(keys.get("field"), direction, ports, connections, reader)
    kind = _kind(keys, port, reader)
    if name is None or number is None or direction is None or port is None or ros is None or kind is None:
        return None
    if is_service and (service is None or not check_service_channel(keys, direction, port, reader)):
        return None
    safe = read_safe(keys["safe"], port.type, direction, reader) if "safe" in keys else ()
    safe_span = keys["safe"].span if safe else None
    if kind == "blob" and safe and not _is_blob(safe):
        message = f"`safe` of `{name}` is no blob"
        why = "element 0 is the number of bytes, and each byte has an element behind it, 0 to 255"
        reader.sink.error(
            "E250", message, keys["safe"].span, why=why, help="write a 0 first, for example, for no bytes"
        )
    return Channel(name, number, port, direction, age, grace, ros, item.span, safe or (), safe_span, kind, service)


def _kind(keys: dict[str, JsonNode], port: PortRef | None, reader: ConfigReader) -> str | None:
    """What the channel says its field is: "field" without `as`. None after reporting an error."""
    if "as" not in keys:
        return "field"
    kind = reader.choice(keys["as"], "`as`", ("quaternion", "blob"))
    if kind is None or port is None:
        return None
    if kind == "quaternion" and port.type not in (Array(F64, (4,)), Array(F32, (4,))):
        message = f"a quaternion is an f64[4] or an f32[4], and `{keys['field'].written}` is {port.type}"
        reader.sink.error("E250", message, keys["as"].span, help="remove `as`, or name another field")
        return None
    if kind == "blob" and not _holds_blob(port.type):
        message = f"a blob is a u32[1 + N], and `{keys['field'].written}` is {port.type}"
        why = "element 0 is the number of bytes, and each byte has an element behind it"
        fix = "declare it `u32[65]`, for example, for 64 bytes"
        reader.sink.error("E250", message, keys["as"].span, why=why, help=fix)
        return None
    if kind == "blob" and "ros" in keys:
        why = "no standard message has one"
        reader.sink.error("E250", "a blob with `ros`", keys["ros"].span, why=why, help="remove `ros`")
        return None
    return kind


def _holds_blob(type_: Type) -> bool:
    return isinstance(type_, Array) and type_.element == U32 and len(type_.shape) == 1 and type_.count > 1


def _is_blob(values: Values) -> bool:
    count, *elements = (value for value in values if not isinstance(value, str))
    return count <= len(elements) and all(element <= 255 for element in elements)


def default_topic(name: str) -> str:
    """Default ROS topic of a channel: imu.gyro → imu; front.imu.gyro → front/imu; altitude → altitude."""
    return (name.rpartition(".")[0] or name).replace(".", "/")


def read_ros(node: JsonNode, topic: str, reader: ConfigReader) -> RosMapping | None:
    """Reads the `ros` entry of a channel. Checks that need the message definitions follow in ros.py. `topic`: the
    default topic."""
    keys = reader.object(node, "`ros`", ("type", "field"), ("topic", "frame", "child_frame", "axes", "choices"))
    if keys is None or "type" not in keys or "field" not in keys:
        return None
    found = {"topic": topic}
    frame = ("a frame", "write the frame_id, such as imu_link, or omit it")
    for key, pattern, what, fix in (
        ("type", _ROS_TYPE, "a message type", "write package/Type, such as sensor_msgs/Imu, without /msg/"),
        ("field", _ROS_FIELD, "a field of a message", "such as angular_velocity, angular_velocity.x or axes[1]"),
        ("topic", _ROS_TOPIC, "a topic", "write it relative to the namespace, such as imu/data"),
        ("frame", _ROS_FRAME, *frame),
        ("child_frame", _ROS_FRAME, *frame),
    ):
        text = reader.string(keys.get(key), f"`{key}`")
        if text is not None and not pattern.fullmatch(text):
            reader.sink.error("E203", f"`{text}` is not {what}", keys[key].span, help=fix)
            return None
        found.setdefault(key, "") if text is None else found.update({key: text})
    axes = reader.choice(keys.get("axes"), "`axes`", AXES)
    if axes is None and "axes" in keys:
        return None
    choices = _choices(keys["choices"], reader) if "choices" in keys else ()
    interfaces = find_message(found["type"], keys["type"], reader.sink)
    if interfaces is None or choices is None:
        return None
    spans = {key: keys[key].span for key in keys}
    return RosMapping(**found, axes=axes or "", choices=choices, interfaces=interfaces, spans=spans)


def _choices(node: JsonNode, reader: ConfigReader) -> tuple[str | int, ...] | None:
    """Strings and whole numbers. None after reporting an error."""
    found: list[str | int] = []
    for item in reader.list(node, "`choices`"):
        if not isinstance(item.value, (str, int)) or isinstance(item.value, bool):
            fix = "write strings, names of constants of the message, or whole numbers"
            reader.sink.error("E258", "`choices` has something else than these", item.span, help=fix)
            return None
        found.append(item.value)
    if not found:
        reader.sink.error("E258", "`choices` is empty", node.span, help="list what the indices 0, 1, … stand for")
        return None
    return tuple(found)


def _bound(
    node: JsonNode | None,
    direction: str | None,
    ports: PortResolver,
    connections: list[Connection],
    reader: ConfigReader,
) -> PortRef | None:
    """The port of a channel. A sensor writes an output of a source block or a host input; an actuator and a report read
    an output."""
    if node is None or direction is None:
        return None
    if direction == "sensor":
        port = ports.port(node, ("outputs", "inputs"), "a sensor is an output or an input")
    else:
        port = ports.port(
            node, ("outputs",), f"{'an actuator' if direction == 'actuator' else 'a report'} is an output"
        )
    if port is not None and not isinstance(element_of(port.type), Scalar):
        fix = f"name a member: `{node.written}.…`"
        reader.sink.error("E217", "a channel carries a scalar or an array, not a struct", node.span, help=fix)
        return None
    if port is not None and element_of(port.type) in (HEALTH, REQUEST):
        message = f"a {element_of(port.type)} cannot be sent on a channel"
        reader.sink.error("E217", message, node.span, help="bind numbers and bools")
        return None
    if port is not None and (size := count_of(port.type) * scalar_of(port.type).size) > _MAX_BYTES:
        message = f"a channel has at most {_MAX_BYTES} bytes, and `{node.written}` has {size}"
        reader.sink.error(
            "E217",
            message,
            node.span,
            why="a message counts the values of a channel in 16 bits",
            help="use several channels",
        )
        return None
    if port is None or direction != "sensor":
        return port
    if port.record == "inputs":
        connection = next(
            (c for c in connections if (c.target.instance, c.target.field) == (port.instance, port.field)), None
        )
        if connection is not None:
            fix = "an input has one source; remove the connection or the channel"
            notes = [(connection.span, "connected here")]
            reader.sink.error("E213", f"two sources for `{node.written}`", node.span, help=fix, notes=notes)
            return None
    else:
        algorithm = ports.instances[port.instance].algorithm
        written = next((s for f, s in assigned_outputs(algorithm) if f == port.field), None)
        if written is not None:
            fix = "bind the channel to an input, or leave the output to the channel"
            reader.sink.error(
                "E227",
                f"`{node.written}` is also assigned by its algorithm",
                node.span,
                help=fix,
                notes=[(written, "here")],
            )
            return None
    return port


def assigned_outputs(algorithm: ir.Algorithm) -> list[tuple[str, Span]]:
    """Outputs that execute or start assigns, with the first assignment."""
    found: dict[str, Span] = {}
    for function in (algorithm.execute, algorithm.start):
        for target, _, span in ir.writes(function.body) if function is not None else ():
            root = ir.root(target)
            if isinstance(root, ir.Field) and root.record == "outputs":
                found.setdefault(root.name, span)
    return list(found.items())
