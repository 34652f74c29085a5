# SPDX-License-Identifier: Apache-2.0
"""Generates the ROS 2 messages of instances and structs. rosidl, the schemas in bags and all decoders use the same
text."""

from __future__ import annotations

import re

from ..model import ir
from ..model.machine import Instance, Machine
from ..model.ros_names import ros_field
from ..model.types import HEALTH, HEALTH_NAMES, REQUEST, Array, Scalar, Struct, Type, element_of

_SEPARATOR = "=" * 80 + "\n"
#: Characters not allowed in comments: rosidl interprets brackets as a unit, and fails on a backslash.
_DOC_FOR_ROSIDL = str.maketrans("[]\\", "()/")


def camel(name: str) -> str:
    """lander_control → LanderControl, att.rate → AttRate."""
    return "".join(part[:1].upper() + part[1:] for part in re.split("[_.]", name))


def message_name(machine: Machine, instance: Instance) -> str:
    """Message name of an instance, such as LanderControlAscent."""
    return camel(machine.name) + camel(instance.name)


def message_fields(machine: Machine, instance: Instance) -> list[ir.Port]:
    """The outputs in the message, health last. transition_request is included only if the algorithm makes requests."""
    outputs = instance.algorithm.ports["outputs"]
    makes = instance.algorithm.makes_requests
    return [p for p in outputs if p.name != "health" and (p.name != "transition_request" or makes)]


def ros_type(machine: Machine, type_: Type) -> str:
    """Type of a value, or of an array's element, in a .msg file. A struct is a separate message."""
    element = element_of(type_)
    return element.ros if isinstance(element, Scalar) else struct_message_name(machine, element)


def struct_message_name(machine: Machine, struct: Struct) -> str:
    """Message name of a struct, such as RoverPose."""
    return camel(machine.name) + struct.name


def message_structs(machine: Machine, instance: Instance) -> list[Struct]:
    """The structs that an instance's message contains, directly or nested, in dependency order."""
    held = {s.name for port in message_fields(machine, instance) for s in _structs_in(port.type)}
    return [s for s in machine.structs if s.name in held]


def _structs_in(type_: Type) -> list[Struct]:
    element = element_of(type_)
    if isinstance(element, Scalar):
        return []
    return [element, *(s for m in element.members for s in _structs_in(m.type))]


def struct_message_text(machine: Machine, struct: Struct) -> str:
    """The .msg file of a struct."""
    lines = [f"# Struct {struct.name} of machine {machine.name}."]
    held = {element_of(m.type) for m in struct.members}
    if REQUEST in held:
        lines += _constants_of_requests(machine, machine.requests)
    if HEALTH in held:
        lines += _constants_of_healths()
    lines += [_declaration(machine, m.name, m.type, m.unit, "") for m in struct.members]
    return "\n".join(lines) + "\n"


def message_texts(machine: Machine) -> dict[str, str]:
    """The .msg files of a machine by message name: published instances in JSON order, then the structs they contain."""
    published = [i for i in machine.instances if i.published]
    held = {s.name: s for i in published for s in message_structs(machine, i)}
    texts = {message_name(machine, i): message_text(machine, i) for i in published}
    return texts | {struct_message_name(machine, s): struct_message_text(machine, s) for s in held.values()}


def message_definition(machine: Machine, instance: Instance) -> str:
    """The text of a message, followed by the texts of its structs with the separators of ros2msg."""
    parts = [message_text(machine, instance)]
    for struct in message_structs(machine, instance):
        name = f"{machine.package}/{struct_message_name(machine, struct)}"
        parts.append(f"{_SEPARATOR}MSG: {name}\n{struct_message_text(machine, struct)}")
    return "".join(parts)


def message_text(machine: Machine, instance: Instance) -> str:
    """The .msg file of an instance."""
    lines = [
        f"# Outputs of instance {instance.name} (algorithm {instance.algorithm.name}) of machine {machine.name}.",
        "std_msgs/Header header # stamp: time of the tick",
        "uint64 tick # the tick these outputs are of",
    ]
    constants = _constants_of_requests(machine, message_requests(machine, instance))
    for port in message_fields(machine, instance):
        if element_of(port.type) == REQUEST:
            lines += constants
            constants = []
        lines.append(_declaration(machine, port.name, port.type, port.unit, port.doc))
    lines += [*_constants_of_healths(), "uint8 health"]
    return "\n".join(lines) + "\n"


def message_requests(machine: Machine, instance: Instance) -> tuple[str, ...]:
    """Requests for which the message has a constant: those that its fields may hold."""
    holders = [p.name for p in message_fields(machine, instance) if element_of(p.type) == REQUEST]
    return machine.requests if holders not in ([], ["transition_request"]) else machine.requests_of(instance)


def _constants_of_requests(machine: Machine, requests: tuple[str, ...]) -> list[str]:
    made = [f"int32 TR_{request_constant(name)}={machine.requests.index(name) + 1}" for name in requests]
    return ["int32 TR_NONE=0", *made]


def _constants_of_healths() -> list[str]:
    return [f"uint8 {name.upper()}={number}" for number, name in enumerate(HEALTH_NAMES)]


def _declaration(machine: Machine, name: str, type_: Type, unit: str, doc: str) -> str:
    """One field of a .msg file. ROS arrays have one dimension."""
    shape = f"[{type_.count}]" if isinstance(type_, Array) else ""
    # Note on the constants of a field and its row order, without brackets, which rosidl interprets as a unit.
    words = str(element_of(type_)) if element_of(type_) in (HEALTH, REQUEST) and name != "transition_request" else ""
    rows = (
        f"{' x '.join(map(str, type_.shape))}, row-major" if isinstance(type_, Array) and len(type_.shape) > 1 else ""
    )
    text = "; ".join(filter(None, (words, rows, doc.translate(_DOC_FOR_ROSIDL))))
    comment = " ".join(filter(None, (f"[{unit}]" if unit else "", text)))
    return f"{ros_type(machine, type_)}{shape} {ros_field(name)}" + (f" # {comment}" if comment else "")


def request_constant(request: str) -> str:
    """Name of a request's constant. rosidl requires UPPER_SNAKE_CASE."""
    out = ""
    for position, char in enumerate(request):
        if char.isupper() and position and request[position - 1].islower():
            out += "_"
        out += char.upper()
    return out
