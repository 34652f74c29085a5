# SPDX-License-Identifier: Apache-2.0
"""The linear equations of a plant around a point: dx' = A dx + B du, dy = C dx + D du."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from ..errors import SimError
from .plant import Array, Plant, Variable

#: Of a variable of size 1: where errors of fourth order and of rounding are alike.
_STEP = 2.0**-10


@dataclass(frozen=True)
class Linear:
    """`a` n x n, `b` n x m, `c` p x n, `d` p x m, of `states`, `inputs`, `outputs` in this order; `x`, `u`, `y` and `slopes` (x') are
    those of the point. Units are SI."""

    states: list[Variable]
    inputs: list[Variable]
    outputs: list[Variable]
    a: Array
    b: Array
    c: Array
    d: Array
    x: Array
    u: Array
    y: Array
    slopes: Array

    def as_json(self) -> dict[str, Any]:
        names = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        numbers = {"A": self.a, "B": self.b, "C": self.c, "D": self.d, "x": self.x, "u": self.u, "y": self.y}
        return {
            **{key: [variable.path for variable in variables] for key, variables in names.items()},
            **{f"{key[:-1]}_units": [variable.unit for variable in variables] for key, variables in names.items()},
            **{key: values.tolist() for key, values in numbers.items()},
            "slopes": self.slopes.tolist(),
        }

    def text(self) -> str:
        """The size, and a line for each mode: eigenvalue, natural frequency, damping."""
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        lines = [f"{n} states, {m} inputs, {p} outputs; largest |x'| of the point: {_largest(self.slopes):.3g}"]
        for value in sorted(np.linalg.eigvals(self.a), key=lambda v: (abs(v), v.imag)):
            if value.imag < 0.0:
                continue
            size = abs(value)
            kind = f"damping {-value.real / size:.4g}" if size > 0.0 else "integrator"
            pair = f" ± {value.imag:.6g}j" if value.imag > 0.0 else ""
            lines.append(f"  {value.real:.6g}{pair} 1/s: {size:.6g} rad/s, {kind}")
        return "\n".join(lines)

    def write(self, path: Any) -> None:
        path.write_text(json.dumps(self.as_json(), indent=1) + "\n")


def linearise(
    plant: Plant, inputs: Sequence[str], outputs: Sequence[str], states: Sequence[str] | None = None
) -> Linear:
    """Around the present of the plant, by central differences with one Richardson extrapolation: the error is of fourth order in
    the step, 1/1024 of the variable or of 1, whichever is larger. inputs, outputs: paths; an array is all of its elements. states:
    patterns of those to keep (all); the others are held. Raises SimError."""
    chosen = [s for s in plant.states if states is None or any(fnmatchcase(s.path, pattern) for pattern in states)]
    if not chosen:
        raise SimError(
            f"no continuous state matches {', '.join(states or ())}" if states else "the plant has no states"
        )
    u = [variable for path in inputs for variable in plant.variables(path, ("input",))]
    y = [variable for path in outputs for variable in plant.variables(path, ("output",))]
    for variable in u:
        if plant.is_fed_by_a_model(variable):
            raise SimError(f"`{variable.path}` is fed by another model: it is no input of the plant")
    numbers = [state.slope for state in chosen]
    slopes = plant.slopes()[numbers]
    point = plant.get(chosen), plant.get(u), plant.get(y)
    columns = [_column(plant, variable, numbers, y) for variable in (*chosen, *u)]
    plant.slopes()  # outputs are those of the point again
    whole = np.array(columns).T.reshape(len(chosen) + len(y), len(columns))
    n = len(chosen)
    return Linear(chosen, u, y, whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:], *point, slopes)


def _column(plant: Plant, variable: Variable, numbers: Sequence[int], outputs: Sequence[Variable]) -> Array:
    """What slopes and outputs change by, for a change of the variable."""
    (middle,) = plant.get([variable])
    step = _STEP * max(1.0, abs(middle))

    def at(value: float) -> Array:
        plant.set([variable], [value])
        return np.concatenate([plant.slopes()[list(numbers)], plant.get(outputs)])

    coarse = (at(middle + step) - at(middle - step)) / (2.0 * step)
    fine = (at(middle + 0.5 * step) - at(middle - 0.5 * step)) / step
    plant.set([variable], [middle])
    return np.asarray((4.0 * fine - coarse) / 3.0)


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if len(values) else 0.0
