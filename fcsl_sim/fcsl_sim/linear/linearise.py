# SPDX-License-Identifier: Apache-2.0
"""The linear equations of a plant around a point: dx' = A dx + B du, dy = C dx + D du."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from ..errors import SimError
from .plant import Array, Plant, Variable

#: The first step for a variable of size 1, and how often it is divided by 4 until two results agree so well.
_STEP, _TIMES, _AGREE = 2.0**-10, 8, 1e-9


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
    """Around the present of the plant, by central differences with one Richardson extrapolation, so of fourth order in the
    step. That begins at 1/1024 of the variable or of 1, whichever is larger, and becomes smaller until two results agree to
    1e-9; what never does gets the one that has changed least. inputs, outputs: paths; an array is all of its elements. states:
    patterns of those to keep (all); the others are held. Raises SimError."""
    patterns = [pattern.replace("[", "[[]") for pattern in states or ()]  # an index, no set of characters
    chosen = [s for s in plant.states if states is None or any(fnmatchcase(s.path, pattern) for pattern in patterns)]
    if not chosen:
        raise SimError(
            f"no continuous state matches {', '.join(states or ())}" if states else "the plant has no states"
        )
    u = [variable for path in inputs for variable in plant.variables(path, ("input",))]
    y = [variable for path in outputs for variable in plant.variables(path, ("output",))]
    for variable in y:
        if not plant.config.tables[variable.instance].has_output:
            raise SimError(f"`{variable.path}` is made by an `update`: it stands still, and depends on nothing here")
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

    def difference(step: float) -> Array:
        values = []
        for value in (middle + step, middle - step):
            plant.set([variable], [value])
            values.append(np.concatenate([plant.slopes()[list(numbers)], plant.get(outputs)]))
        return np.asarray((values[0] - values[1]) / (2.0 * step))

    step = _STEP * max(1.0, abs(middle))
    best = before = _richardson(difference, step)
    least = np.full(best.shape, np.inf)
    for _ in range(_TIMES):
        step /= 4.0
        now = _richardson(difference, step)
        change = np.abs(now - before)
        better = (change < least) & (least > _AGREE * np.abs(best))
        best, least, before = np.where(better, now, best), np.where(better, change, least), now
        if (least <= _AGREE * np.abs(best)).all():
            break
    plant.set([variable], [middle])
    return best


def _richardson(difference: Callable[[float], Array], step: float) -> Array:
    return (4.0 * difference(0.5 * step) - difference(step)) / 3.0


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if len(values) else 0.0
