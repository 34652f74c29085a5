# SPDX-License-Identifier: Apache-2.0
"""Equilibria of a plant: states, inputs and parameters for which chosen derivatives are zero and outputs have given values."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile
from fcsl_compiler.api.files import SourceError, write_whole
from fcsl_compiler.api.json_files import ConfigReader, JsonNode, SourcePathError, parse_json, resolve_source
from fcsl_compiler.api.types import shape_of

from ..config import SimConfig, load
from ..element_path import split_path
from ..errors import SimError
from .plant import Array, Plant, Variable

_LARGEST = 1e300
_TOLERANCE = 1e-9
#: A residual where the plant has none.
_FAR = 1e30
#: What an unknown may be.
_ROLES = ("state", "input", "parameter")


@dataclass(frozen=True)
class Unknown:
    path: str
    start: float
    within: tuple[float, float]


@dataclass(frozen=True)
class TrimProblem:
    """`steady` are paths of states whose derivatives are zero, `outputs` have these values."""

    path: Path
    simulation: Path
    config: SimConfig
    unknowns: tuple[Unknown, ...]
    steady: tuple[str, ...]
    outputs: dict[str, float]
    tolerance: float


@dataclass(frozen=True)
class Trimmed:
    """`values` of the unknowns; `fields` are the whole inputs and parameters that they are or belong to; `residuals` of the
    conditions by path; whether all are within the tolerance."""

    values: dict[str, float]
    fields: dict[str, Any]
    residuals: dict[str, float]
    is_equilibrium: bool

    def text(self) -> str:
        worst = max(self.residuals, key=lambda path: abs(self.residuals[path]))
        lines = [f"  {path} = {value:.9g}" for path, value in self.values.items()]
        end = f"largest residual {abs(self.residuals[worst]):.3g}, of {worst}"
        return "\n".join(["an equilibrium" if self.is_equilibrium else "no equilibrium was found", *lines, end])

    def as_json(self) -> dict[str, Any]:
        return {"equilibrium": self.is_equilibrium, "values": self.values, "residuals": self.residuals}


def read_trim(path: Path) -> TrimProblem:
    """Reads a *.trim.json. Raises DiagnosticError with all errors of the file, or SimError."""
    try:
        source = SourceFile.read(path, str(path))
    except SourceError as error:
        raise SimError(f"{path}: {error}") from None
    sink = DiagnosticSink()
    root = parse_json(source, sink)
    sink.raise_if_failed()
    assert root is not None
    reader = ConfigReader(sink)
    keys = (
        reader.object(root, "a trim", ("simulation", "unknowns"), ("description", "steady", "outputs", "tolerance"))
        or {}
    )
    text = reader.string(keys.get("simulation"), "`simulation`", "rover.sim.json")
    unknowns = _unknowns(keys.get("unknowns"), reader)
    steady = [reader.string(item, "a path") for item in reader.list(keys.get("steady"), "`steady`")]
    outputs = _outputs(keys.get("outputs"), reader)
    tolerance = reader.number(keys.get("tolerance"), "`tolerance`", 1e-300, _LARGEST) or _TOLERANCE
    sink.raise_if_failed()
    assert text is not None
    try:
        file = resolve_source(text, config=path) if text.startswith("package://") else path.parent / text
    except SourcePathError as error:
        raise SimError(f"{text}: {error}") from None
    paths = tuple(item for item in steady if item is not None)
    if not paths and not outputs:
        raise SimError(f"{path}: it has no condition: name states in `steady`, or values in `outputs`")
    return TrimProblem(path, file, load(file), unknowns, paths, outputs, tolerance)


def _unknowns(node: JsonNode | None, reader: ConfigReader) -> tuple[Unknown, ...]:
    if node is not None and node.kind != "object":
        reader.wrong(node, "`unknowns` is an object from path to start", '{"servo.inputs.command": {"start": 0.0}}')
        return ()
    found = []
    for path, member in node.members.items() if node else ():
        keys = reader.object(member.value, f"`{path}`", ("start",), ("within",)) or {}
        start = reader.number(keys.get("start"), "`start`", -_LARGEST, _LARGEST)
        items = reader.list(keys.get("within"), "`within`")
        ends = [reader.number(item, "a bound", -_LARGEST, _LARGEST) for item in items]
        low, high = (ends[0], ends[1]) if len(ends) == 2 else (-np.inf, np.inf)
        if items and (
            len(ends) != 2 or low is None or high is None or start is None or not low < high or not low <= start <= high
        ):
            reader.sink.error("E204", "`within` is a list of two bounds, with `start` between", keys["within"].span)
        elif start is not None and low is not None and high is not None:
            found.append(Unknown(path, start, (low, high)))
    return tuple(found)


def _outputs(node: JsonNode | None, reader: ConfigReader) -> dict[str, float]:
    if node is not None and node.kind != "object":
        reader.wrong(node, "`outputs` is an object from path to value", '{"air.outputs.airspeed": 20.0}')
        return {}
    pairs = {
        p: reader.number(m.value, f"`{p}`", -_LARGEST, _LARGEST) for p, m in (node.members.items() if node else ())
    }
    return {path: value for path, value in pairs.items() if value is not None}


def trim(problem: TrimProblem, plant: Plant) -> Trimmed:
    """Solves for the unknowns by least squares, and leaves the plant there. Raises SimError."""
    try:
        from scipy.optimize import least_squares  # imported here, because it takes long to load
    except ImportError:
        raise SimError("a trim needs the Python package `scipy`: python3 -m pip install scipy") from None

    unknowns = [_one(plant, unknown.path, _ROLES) for unknown in problem.unknowns]
    for variable in unknowns:
        if plant.is_fed_by_a_model(variable):
            raise SimError(f"`{variable.path}` is fed by another model: it cannot be chosen")
    steady = [v for path in problem.steady for v in plant.variables(path, ("state",))]
    outputs = [_one(plant, path, ("output",)) for path in problem.outputs]
    wanted = np.array(list(problem.outputs.values()))
    start = np.array([unknown.start for unknown in problem.unknowns])
    bounds = tuple(np.array([unknown.within[i] for unknown in problem.unknowns]) for i in (0, 1))

    def residuals(values: Array) -> Array:
        plant.set(unknowns, values)
        try:
            slopes = plant.slopes()[[state.slope for state in steady]]
        except SimError:
            if np.array_equal(values, start):
                raise
            return np.full(len(steady) + len(outputs), _FAR)  # outside of what the models take: the solver comes back
        return np.concatenate([slopes, plant.get(outputs) - wanted])

    scale = np.maximum(1.0, np.abs(start))
    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "jac": "3-point", "x_scale": scale}
    found = least_squares(residuals, start, bounds=bounds, max_nfev=1000, **exact)
    last = residuals(found.x)
    idle = [variable.path for variable, column in zip(unknowns, found.jac.T, strict=True) if not column.any()]
    if idle:
        raise SimError(
            f"`{idle[0]}` changes none of the conditions; a parameter that only `init` reads cannot be trimmed"
        )
    names = [f"{state.path}'" for state in steady] + [variable.path for variable in outputs]
    values = dict(zip((variable.path for variable in unknowns), found.x.tolist(), strict=True))
    is_equilibrium = bool(np.abs(last).max() <= problem.tolerance)
    return Trimmed(values, _fields(plant, values), dict(zip(names, last.tolist(), strict=True)), is_equilibrium)


def _fields(plant: Plant, paths: Iterable[str]) -> dict[str, Any]:
    """Inputs and parameters as a simulation file has them, whole."""
    found = {}
    for path in paths:
        whole, _ = split_path(path)
        instance, record, rest = whole.split(".", 2)
        if record != "state":
            shape = shape_of(plant.config.tables[instance].fields[f"{record}.{rest}"].type)
            values = plant.get(plant.variables(whole, _ROLES))
            found[whole] = values.reshape(shape).tolist() if shape else float(values[0])
    return found


def _one(plant: Plant, path: str, roles: Sequence[str]) -> Variable:
    found = plant.variables(path, roles)
    if len(found) != 1:
        raise SimError(f"`{path}` has {len(found)} elements: name one, `{path}[0]`")
    return found[0]


def trimmed_file(problem: TrimProblem, trimmed: Trimmed, path: Path) -> dict[str, Any]:
    """A simulation file beside `path` that extends the problem's with the inputs and parameters found. States begin where
    parameters of their models say, so they are not in it."""
    instances: dict[str, dict[str, dict[str, Any]]] = {}
    for name, value in trimmed.fields.items():
        instance, record, field = name.split(".", 2)
        instances.setdefault(instance, {}).setdefault(record, {})[field] = value
    base = os.path.relpath(problem.simulation.resolve(), path.resolve().parent)
    return {"extends": base, "description": f"Trimmed by {problem.path.name}.", "instances": instances}


def write_trimmed(problem: TrimProblem, trimmed: Trimmed, path: Path) -> None:
    if path.exists():
        raise SimError(f"{path}: exists already")
    write_whole(path, json.dumps(trimmed_file(problem, trimmed, path), indent=2) + "\n")
