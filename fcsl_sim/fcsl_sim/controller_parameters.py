# SPDX-License-Identifier: Apache-2.0
"""Parameters of the machines in a simulation, by the paths of `--set`, studies and metrics: `rate.parameters.k[0]`, and
`<controller>.rate.parameters.k[0]` for one beside the first controller.

A flight with other values begins as one of a machine compiled with them: they are bound before `start`, by the parameter file
(simclient/parameters.py) that `StartValues` makes of them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from ctypes import string_at
from dataclasses import dataclass
from typing import Any

from fcsl_compiler.api.diagnostics import DiagnosticSink, Span
from simclient.descriptor import Field, Machine
from simclient.parameters import Parameters, parameter_name
from simclient.values import decode, nest

from .models import FIELD_TYPES, ModelField, ModelTable, type_of
from .native import Simulation
from .plan import Plan, Target

Scalar = bool | int | float


@dataclass(frozen=True)
class ControllerParameter:
    """`field` is as the descriptor has it, `shown` as a model's field. `shared`: another controller flies the same machine."""

    controller: str
    field: Field
    shown: ModelField
    shared: bool

    @property
    def target(self) -> tuple[str, str]:
        """Of a Target: without the element."""
        return self.controller, self.field.path

    def is_settable(self, path: str, span: Span, sink: DiagnosticSink) -> bool:
        """False after reporting why it keeps its value."""
        if self.field.frozen:
            why = "the compiler folded its value into the code"
            fix = "take it out of `frozen` in the machine JSON"
            sink.error("E214", f"`{path}` is frozen", span, why=why, help=fix)
        elif self.shared:
            why = "a parameter file names a machine, so both would get the value"
            fix = "give one of them a machine JSON of its own"
            sink.error("E214", f"another controller flies the machine of `{path}`", span, why=why, help=fix)
        return not (self.field.frozen or self.shared)

    def is_in_range(self, values: Sequence[Any], path: str, span: Span, sink: DiagnosticSink) -> bool:
        """False after reporting a value outside of the range that the algorithm declares."""
        outside = next((v for v in values if not self.field.minimum <= v <= self.field.maximum), None)
        if outside is not None:
            fix = "choose a value inside, or widen the range in the algorithm"
            sink.error("E204", f"`{path}` is {outside}, outside {self.range_text}", span, help=fix)
        return outside is None

    @property
    def range_text(self) -> str:
        """As an algorithm declares it: `0.01..2.0`."""
        number = float if self.field.type in ("f32", "f64") else int
        ends = (self.field.minimum, self.field.maximum)
        return "..".join("" if math.isinf(end) else str(number(end)) for end in ends)


def controller_parameters(machines: Mapping[str, Machine]) -> dict[str, ControllerParameter]:
    """Those of numbers and bools, by path. machines: by controller; the first one leads."""
    found = {}
    names = [machine.name for machine in machines.values()]
    for number, (controller, machine) in enumerate(machines.items()):
        for field in machine.fields.values():
            if field.role == "parameter" and field.type in FIELD_TYPES:
                own = field.path.removeprefix(f"{field.instance}.")
                type_ = type_of(field.type, field.shape)
                shown = ModelField(own, field.role, False, False, False, type_, field.offset, field.unit, field.doc)
                path = f"{controller}.{field.path}" if number else field.path
                found[path] = ControllerParameter(controller, field, shown, names.count(machine.name) > 1)
    return found


class StartValues:
    """With which the controllers of a simulation begin, to be changed for many flights."""

    def __init__(self, plan: Plan, tables: Mapping[str, ModelTable], machines: Mapping[str, Machine]):
        """Raises SimError."""
        self._machines = machines
        #: By controller and path, row by row.
        self._values: dict[tuple[str, str], list[Any]] = {}
        #: What a parameter file of the user gives stays, whatever else changes.
        self._given: dict[str, set[str]] = {controller: set() for controller in machines}
        with Simulation(plan, tables) as sim:
            for (controller, machine), data in zip(machines.items(), sim.controller_data(), strict=True):
                for field in machine.fields.values():
                    if field.role == "parameter" and not field.frozen:
                        value = decode(string_at(data + field.offset, field.size), field, (field.count,), machine)
                        self._values[controller, field.path] = value
                        if plan.parameters is not None and all(_is_finite(one) for one in value):
                            self._given[controller].add(field.path)

    def element(self, target: Target) -> Scalar:
        controller, path, element = target
        value: Scalar = self._values[controller, path][int(element)]
        return value

    def with_values(self, values: Mapping[Target, Scalar | str]) -> Parameters | None:
        """The parameter file of a flight with these elements; None where nothing differs from what was compiled."""
        changed: dict[tuple[str, str], list[Any]] = {}
        for (controller, path, element), new in values.items():
            changed.setdefault((controller, path), list(self._values[controller, path]))[int(element)] = new
        sections: dict[str, Any] = {}
        for controller, machine in self._machines.items():
            rows: dict[str, Any] = {}
            for field in machine.fields.values():
                at = controller, field.path
                if at in changed or field.path in self._given[controller]:
                    value = changed.get(at) or self._values[at]
                    rows[parameter_name(field)] = nest(value, field.shape) if field.shape else value[0]
            if rows:
                sections[machine.name] = rows
        if not sections:
            return None
        text = {machine: {"ros__parameters": rows} for machine, rows in sections.items()}
        return Parameters(json.dumps(text, ensure_ascii=False).encode(), "parameters")


def _is_finite(value: Any) -> bool:
    """What a parameter file can hold."""
    return not isinstance(value, float) or math.isfinite(value)
