# SPDX-License-Identifier: Apache-2.0
"""Names of what a machine consists of in generated code, as identifiers of C."""

from __future__ import annotations

from ..model import ir
from ..model.c_names import c_name
from ..model.code import Name
from ..model.machine import Channel, Instance, Machine
from ..model.types import Leaf, Struct

HEALTH_CONSTANTS = ("FCSL_NOMINAL", "FCSL_DEGRADED", "FCSL_FAILED", "FCSL_STALE")

#: Argument in which a function returns its first fault: 0, or the number of its place.
FAULT = Name("fault_")
#: Argument of a function that reads hardware.
HOST = Name("host_")
#: Argument for a result with storage.
RESULT = Name("result_")


def health(index: int) -> Name:
    return Name(HEALTH_CONSTANTS[index])


def struct_type(machine: str, struct: Struct) -> str:
    """A struct of this machine."""
    return f"{machine}_{struct.name}_t"


def record_type(machine: Machine, algorithm: ir.Algorithm, record: str) -> str:
    return f"{machine.name}_{algorithm.name}_{record}_t"


def instance_type(machine: Machine, instance: Instance) -> str:
    return f"{machine.name}_{instance.identifier}_t"


def machine_type(machine: Machine) -> str:
    return f"{machine.name}_t"


def state_constant(machine: Machine, index: int) -> Name:
    return Name(f"{machine.name}_STATE_{machine.states[index].name}")


def request_constant(machine: str, name: str) -> str:
    """`name` "" is no request."""
    return f"{machine}_tr_{name or 'none'}"


def constant_name(owner: str, name: str) -> str:
    """A constant with storage. No helper of its file has the same name."""
    return f"{owner}__{name}"


def instance_member(instance: Instance) -> str:
    return f"i_{instance.identifier}"


def channel_member(channel: Channel) -> str:
    return "channel_" + channel.name.replace(".", "_") + "_"


def channel_type(machine: Machine, with_last_sample: bool) -> str:
    return f"fcsl_{'timed_' if with_last_sample else ''}sensor_{machine.name}_t"


def leaf_member(leaf: Leaf) -> str:
    """C member expression of a leaf relative to its port."""
    return "".join(f"[{s}]" if isinstance(s, int) else f".{c_name(s)}" for s in leaf.steps)


def sensors(machine: Machine) -> list[Channel]:
    return [c for c in machine.channels if c.direction == "sensor"]
