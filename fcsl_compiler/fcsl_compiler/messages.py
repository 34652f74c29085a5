# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 message of an instance: one text, for rosidl, for the schema in a bag, and for whoever decodes either."""

from __future__ import annotations

from . import ir
from .machine import Instance, Machine
from .types import HEALTH, HEALTH_NAMES, REQUEST, Array, Scalar, Type, element_of


def camel(name: str) -> str:
    """lander_control → LanderControl."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def message_name(machine: Machine, instance: Instance) -> str:
    """Such as LanderControlAscent."""
    return camel(machine.name) + camel(instance.name)


def message_fields(machine: Machine, instance: Instance) -> list[ir.Port]:
    """The outputs that travel: transition_request only where the algorithm makes requests, health last."""
    outputs = instance.algorithm.ports["outputs"]
    makes = bool(machine.requests_of(instance))
    return [p for p in outputs if p.type is not HEALTH and (p.type is not REQUEST or makes)]


def ros_type(machine: Machine, type_: Type) -> str:
    """What a .msg file calls a value, or an element of an array: a struct is a message of its own."""
    element = element_of(type_)
    return element.ros if isinstance(element, Scalar) else camel(machine.name) + element.name


def message_text(machine: Machine, instance: Instance) -> str:
    """The .msg file."""
    lines = [
        f"# Outputs of instance {instance.name} (algorithm {instance.algorithm.name}) of machine {machine.name}.",
        "std_msgs/Header header # stamp: time of the tick",
        "uint64 tick # the tick these outputs are of",
    ]
    for port in message_fields(machine, instance):
        if port.type is REQUEST:
            lines.append("int32 TR_NONE=0")
            for name in machine.requests_of(instance):
                lines.append(f"int32 TR_{request_constant(name)}={machine.requests.index(name) + 1}")
            lines.append("int32 transition_request")
            continue
        shape = f"[{port.type.count}]" if isinstance(port.type, Array) else ""
        comment = " ".join(
            part
            for part in (
                f"[{port.unit}]" if port.unit else "",
                f"{port.type}, row-major" if isinstance(port.type, Array) and len(port.type.shape) > 1 else "",
                port.doc,
            )
            if part
        )
        lines.append(f"{ros_type(machine, port.type)}{shape} {port.name}" + (f" # {comment}" if comment else ""))
    for number, name in enumerate(HEALTH_NAMES):
        lines.append(f"uint8 {name.upper()}={number}")
    lines.append("uint8 health")
    return "\n".join(lines) + "\n"


def request_constant(request: str) -> str:
    """rosidl wants constants in UPPER_SNAKE_CASE."""
    out = ""
    for position, char in enumerate(request):
        if char.isupper() and position and request[position - 1].islower():
            out += "_"
        out += char.upper()
    return out
