# SPDX-License-Identifier: Apache-2.0
"""The plant of a simulation as functions: x' = f(x, u), y = g(x, u)."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import TracebackType
from typing import Any, Self

import numpy as np

from fcsl_compiler.api.diagnostics import nearest
from fcsl_compiler.api.types import scalar_of, shape_of

from ..config import SimConfig
from ..element_path import row_major_index, split_path
from ..errors import SimError
from ..models import ModelField
from ..native import Simulation
from ..whole_ticks import whole_ticks

Array = np.ndarray[Any, Any]
_FORMATS = {"f64": "d", "f32": "f"}


@dataclass(frozen=True)
class Variable:
    """A scalar of an instance: where it lies in the struct. `slope`: its number among the derivatives, of a state."""

    path: str
    unit: str
    instance: str
    offset: int
    format: str
    slope: int = -1


class Plant:
    """A simulation whose time stands still. `states` are all continuous ones. Raises SimError.

    at_s: flies there first, with its controller.
    """

    def __init__(self, config: SimConfig, at_s: Fraction | None = None):
        self.config = config
        self._simulation = Simulation(config.plan, config.tables)
        # The first tick gives the inputs their first values.
        try:
            tick = whole_ticks(at_s or Fraction(0), config.machine.tick_hz) + 1
        except ValueError as error:
            self.close()
            raise SimError(str(error)) from None
        while self._simulation.tick < tick and self._simulation.status == "running":
            self._simulation.run(tick - self._simulation.tick)
        if self._simulation.tick < tick:
            end = self._simulation.tick / config.machine.tick_hz
            self.close()
            raise SimError(f"the simulation has ended at {end:g} s, before {float(at_s or 0):g} s")
        self.states = self._all_states()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._simulation.close()

    def _all_states(self) -> list[Variable]:
        found: list[Variable] = []
        for name in self._simulation.instances:
            table = self.config.tables[name]
            for i in range(table.continuous_count):
                offset = table.continuous_offset + 8 * i
                fields = [
                    f for f in table.of_role("state") if f.offset <= offset < f.offset + struct.calcsize(f.format)
                ]
                path = _element_path(name, fields[0], offset) if fields else f"{name}.state[{i}]"
                found.append(Variable(path, fields[0].unit if fields else "", name, offset, "d", len(found)))
        return found

    def variables(self, path: str, roles: Sequence[str]) -> list[Variable]:
        """The scalar at a path, or all of an array. Raises SimError."""
        whole, index = split_path(path)
        instance, _, rest = whole.partition(".")
        table = self.config.tables.get(instance)
        field = table.fields.get(rest) if table else None
        if field is None or field.role not in roles:
            known = [f"{i}.{f.path}" for i, t in self.config.tables.items() for f in t.of_role(*roles)]
            kinds = " or ".join(roles)
            hint = nearest(whole, known)
            raise SimError(f"there is no {kinds} `{path}` of a model" + (f"; {hint}" if hint else ""))
        scalar = scalar_of(field.type).name
        if scalar not in _FORMATS:
            raise SimError(f"`{path}` is {field.type}, no floating number")
        shape = shape_of(field.type)
        if index and (len(index) < len(shape) or row_major_index(index, shape) is None):
            raise SimError(f"`{path}`: there is no such element of {field.type}")
        wanted = [index] if index or not shape else list(np.ndindex(*shape))
        size = struct.calcsize(_FORMATS[scalar])
        found = []
        for place in wanted:
            number = int(np.ravel_multi_index(place, shape)) if shape else 0
            text = whole + "".join(f"[{i}]" for i in place)
            found.append(Variable(text, field.unit, instance, field.offset + number * size, _FORMATS[scalar]))
        if field.role == "state":
            by_path = {state.path: state for state in self.states}
            missing = [variable.path for variable in found if variable.path not in by_path]
            if missing:
                raise SimError(f"`{missing[0]}` is no continuous state")
            return [by_path[variable.path] for variable in found]
        return found

    def is_fed_by_a_model(self, variable: Variable) -> bool:
        """Whether a connection within the plant sets this input."""
        path, _ = split_path(variable.path.partition(".")[2])
        return any(link.words[2:] == (variable.instance, path) for link in self.config.plan.of("link"))

    def get(self, variables: Sequence[Variable]) -> Array:
        return np.array([self._read(variable) for variable in variables])

    def set(self, variables: Sequence[Variable], values: Sequence[float] | Array) -> None:
        for variable, value in zip(variables, values, strict=True):
            self._simulation.write(variable.instance, variable.offset, struct.pack(f"={variable.format}", float(value)))

    def slopes(self) -> Array:
        """x' of all states; the outputs are those of now afterwards. Raises SimError."""
        return np.array(self._simulation.slopes())

    def _read(self, variable: Variable) -> float:
        address = self._simulation.instance_data(variable.instance) + variable.offset
        size = struct.calcsize(variable.format)
        (value,) = struct.unpack(f"={variable.format}", ctypes.string_at(address, size))
        return float(value)


def _element_path(instance: str, field: ModelField, offset: int) -> str:
    shape = shape_of(field.type)
    place = np.unravel_index((offset - field.offset) // 8, shape) if shape else ()
    return f"{instance}.{field.path}" + "".join(f"[{int(i)}]" for i in place)
