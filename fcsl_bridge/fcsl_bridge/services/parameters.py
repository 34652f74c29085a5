# SPDX-License-Identifier: Apache-2.0
"""A machine's parameters as ROS 2 parameters: `pilot.parameters.gain` is `pilot.gain`.

Scalars are bool, integer or double; healths and requests are their names ("degraded", "tr_START"). Arrays are row-major
(of structs: `pilot.targets.0.mass`). The descriptor has unit, documentation and range; a frozen parameter is read-only.
A new value takes effect between two ticks, and is in the bag as a host write, so that a replay applies it at the same
tick. One request of set_parameters_atomically is all or nothing; set_parameters checks each of its parameters
separately. `get` returns the value in effect: an f32 after rounding, and after a restore the checkpoint's value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from simclient.c_machine import TYPE_FORMATS
from simclient.descriptor import Field, Machine
from simclient.errors import TwinError
from simclient.parameters import parameter_name
from simclient.run import Run
from simclient.values import INTEGER_RANGES, encode, enumerators, request_as_read, scalar_reader

_FLOATS = ("f32", "f64")
#: ROS 2 has no larger integer; larger values of a u64 are shown as this.
_INTEGER_MAX = 2**63 - 1
_FROZEN = "frozen: the compiler folded its value into the code; to set it, take it out of `frozen` in the machine JSON"


class MachineParameters:
    """The parameters of a run, declared in a node until `close`."""

    def __init__(self, node: Node, run: Run):
        self._node, self._run = node, run
        self._fields = {parameter_name(f): f for f in run.machine.fields.values() if f.role == "parameter"}
        self._descriptors: dict[str, ParameterDescriptor] = {}
        self._refreshing = False
        for name, field in self._fields.items():
            self._descriptors[name] = _describe(field, run.machine)
            node.declare_parameter(name, self._value(field), self._descriptors[name], ignore_override=True)
        node.add_pre_set_parameters_callback(self._adopt)
        node.add_on_set_parameters_callback(self._judge)
        node.add_post_set_parameters_callback(self._write)

    def close(self) -> None:
        """Undeclares them."""
        self._node.remove_pre_set_parameters_callback(self._adopt)
        self._node.remove_on_set_parameters_callback(self._judge)
        self._node.remove_post_set_parameters_callback(self._write)
        for name, descriptor in self._descriptors.items():
            descriptor.read_only = False  # read-only parameters cannot be undeclared
            self._node.undeclare_parameter(name)

    def refresh(self) -> None:
        """After the machine's memory was replaced: sets the node's values to the machine's."""
        changed = [
            Parameter(name, value=value)
            for name, field in self._fields.items()
            if not field.frozen and _differs(value := self._value(field), self._node.get_parameter(name).value)
        ]
        if not changed:
            return
        self._refreshing = True
        result = self._node.set_parameters_atomically(changed)
        self._refreshing = False
        if not result.successful:
            self._node.get_logger().warning(f"parameters do not show the checkpoint's values: {result.reason}")

    def reapply(self) -> None:
        """After the machine restarted: sets the machine's values to the node's."""
        self._write([self._node.get_parameter(name) for name, field in self._fields.items() if not field.frozen])

    def _value(self, field: Field) -> Any:
        """The machine's value in the form of a ROS 2 parameter."""
        data = self._run.read(field.offset, field.size)
        read = scalar_reader(field, self._run.machine)
        flat = [_shown(read(v), field.type) for v in struct.unpack(f"={field.count}{TYPE_FORMATS[field.type]}", data)]
        return flat if field.shape else flat[0]

    def _adopt(self, parameters: list[Parameter]) -> list[Parameter]:
        """Converts values before they are checked: an integer for a double, a double for an f32, a request to the
        form in which it reads back."""
        machine = self._run.machine
        return [
            Parameter(p.name, value=_adopted(p.value, self._fields[p.name], machine)) if p.name in self._fields else p
            for p in parameters
        ]

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            for name, field, value in self._ours(parameters):
                _bytes(value, name, field, self._run.machine)
                _check(value, name, field)
        except TwinError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _write(self, parameters: Sequence[Parameter]) -> None:
        for name, field, value in self._ours(parameters):
            data = _bytes(value, name, field, self._run.machine)
            if data != self._run.read(field.offset, field.size):
                self._run.set(field.index, 0, data)

    def _ours(self, parameters: Sequence[Parameter]) -> list[tuple[str, Field, Any]]:
        """Name, field and value of each machine parameter to be written."""
        if self._refreshing:
            return []
        return [(p.name, self._fields[p.name], p.value) for p in parameters if p.name in self._fields]


def _shown(value: Any, type_name: str) -> Any:
    return min(value, _INTEGER_MAX) if type_name == "u64" else value


def _differs(one: Any, other: Any) -> bool:
    """Whether two parameter values are not the same; a NaN is the same as a NaN."""
    return repr(list(one) if hasattr(one, "__len__") else one) != repr(
        list(other) if hasattr(other, "__len__") else other
    )


def _adopted(value: Any, field: Field, machine: Machine) -> Any:
    """A number rounded to the field's type, a request in the form in which it reads back; other values unchanged, to be
    refused.
    """
    if field.type not in (*_FLOATS, "TransitionRequest"):
        return value
    if hasattr(value, "__len__") and not isinstance(value, (str, bytes)):
        return [_adopted(item, field, machine) for item in value]
    if field.type == "TransitionRequest":
        return request_as_read(value, machine)
    if type(value) not in (int, float):
        return value
    try:
        return struct.unpack("=f", struct.pack("=f", value))[0] if field.type == "f32" else float(value)
    except OverflowError:
        return value


def _bytes(value: Any, name: str, field: Field, machine: Machine) -> bytes:
    """The bytes of `value`. Raises TwinError for a frozen parameter and for a wrong type or length."""
    if field.frozen:
        raise TwinError(f"{name}: {_FROZEN}")
    if field.shape and hasattr(value, "__len__") and not isinstance(value, str):
        value = list(value)
    return encode(value, field, name, (field.count,) if field.shape else (), machine)


def _check(value: Any, name: str, field: Field) -> None:
    """Raises TwinError for a number that a machine's JSON would not give the parameter: beyond its range, or not finite.
    Only what is given to the node is checked: a checkpoint may hold anything.
    """
    for number in value if field.shape else [value]:
        if field.bounded and not field.minimum <= number <= field.maximum:
            raise TwinError(f"{name}: {number} is not in {_range_text(field)}")
        if field.type in _FLOATS and not math.isfinite(number):
            raise TwinError(
                f"{name}: {number} is not finite, and would spread to all that is computed from it; "
                "give a finite number"
            )


def _range_text(field: Field) -> str:
    """The range in the notation of algorithm files: `0..10`, `0..`, `..5`."""
    low, high = ("" if math.isinf(bound) else f"{bound:g}" for bound in (field.minimum, field.maximum))
    return f"{low}..{high}"


def _describe(field: Field, machine: Machine) -> ParameterDescriptor:
    unit = f"[{field.unit}]" if field.unit else ""
    constraints = [field.type_text] if field.type not in ("bool", "i64", "f64") or field.shape else []
    names = enumerators(field.type, machine)
    constraints += [f"one of {', '.join(map(repr, names))}"] if names else []
    descriptor = ParameterDescriptor(description=" ".join(filter(None, (field.doc, unit))), read_only=field.frozen)
    low, high = field.minimum, field.maximum
    if field.type in _FLOATS and field.bounded:
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    if field.type in INTEGER_RANGES and (field.bounded or field.type != "i64"):
        least, most = INTEGER_RANGES[field.type]
        least, most = math.ceil(max(low, least)), min(math.floor(min(high, most)), _INTEGER_MAX)
        descriptor.integer_range = [IntegerRange(from_value=least, to_value=most)]
    if field.shape and field.bounded:
        constraints.append(f"each in {_range_text(field)}")
    if field.frozen:
        constraints.append(_FROZEN)
    descriptor.additional_constraints = "; ".join(constraints)
    return descriptor
