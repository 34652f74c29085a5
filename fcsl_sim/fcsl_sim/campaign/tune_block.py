# SPDX-License-Identifier: Apache-2.0
"""Reads `tune` of a study: which parameters of controllers are searched, within which bounds, and what is minimised."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from fcsl_compiler.api.diagnostics import nearest
from fcsl_compiler.api.json_files import ConfigReader, JsonNode
from fcsl_compiler.api.types import scalar_of, shape_of
from simclient.descriptor import Machine

from ..controller_parameters import ControllerParameter
from ..element_path import name_an_element, row_major_index, split_path
from ..models import ModelField
from ..plan import Target
from .metric import Metric, MetricError

_EXAMPLE = '{"within": [0.5, 5.0]}'
#: Of candidates: for each parameter, at least by default, and for scipy.
_PER_PARAMETER, _USUAL, _LEAST_POPULATION = 8, 16, 5
_MAX_POPULATION = 10_000
_GENERATIONS, _MAX_GENERATIONS = 30, 100_000


@dataclass(frozen=True)
class Tuned:
    """A parameter of a controller, or an element of one, with its bounds."""

    path: str
    field: ModelField
    target: Target
    low: float
    high: float


@dataclass(frozen=True)
class Tune:
    """Each candidate flies the first `cases` of the study; the others judge the result."""

    parameters: tuple[Tuned, ...]
    minimise: Metric
    cases: int
    population: int
    generations: int


def read_tune(
    node: JsonNode,
    reader: ConfigReader,
    controllers: Mapping[str, ControllerParameter],
    dispersed: Mapping[str, Target],
    metrics: Mapping[str, Metric],
    machine: Machine,
    study_cases: int | None,
) -> Tune | None:
    """None after reporting errors. dispersed: what differs from case to case. study_cases: those of the file; None: its design has no
    such number."""
    required, optional = ("parameters", "minimise", "cases"), ("population", "generations")
    keys = reader.object(node, "`tune`", required, optional)
    if keys is None:
        return None
    if study_cases is None:
        fix = "the first cases tune, the others judge: use `random` or `latin_hypercube`"
        reader.sink.error("E214", "`tune` needs a design with `cases`", node.span, help=fix)
        return None
    found = _parameters(keys.get("parameters"), reader, controllers, dispersed)
    cases = _cases(keys.get("cases"), reader, study_cases)
    minimise = _minimise(keys.get("minimise"), reader, metrics, machine)
    usual = max(_USUAL, _PER_PARAMETER * len(found))
    population, generations = usual, _GENERATIONS
    if "population" in keys:
        population = reader.integer(keys["population"], "`population`", _LEAST_POPULATION, _MAX_POPULATION) or usual
    if "generations" in keys:
        generations = reader.integer(keys["generations"], "`generations`", 1, _MAX_GENERATIONS) or generations
    if not found or cases is None or minimise is None:
        return None
    return Tune(found, minimise, cases, population, generations)


def _parameters(
    node: JsonNode | None,
    reader: ConfigReader,
    controllers: Mapping[str, ControllerParameter],
    dispersed: Mapping[str, Target],
) -> tuple[Tuned, ...]:
    if node is None:
        return ()
    if node.kind != "object" or not node.members:
        example = f'{{"rate.parameters.k[0]": {_EXAMPLE}}}'
        reader.wrong(node, "`parameters` of `tune` is an object from path to bounds, not empty", example)
        return ()
    found = []
    for path, member in node.members.items():
        sink, span = reader.sink, member.key_span
        whole, index = split_path(path)
        parameter = controllers.get(whole)
        if parameter is None:
            floats = [p for p, c in controllers.items() if scalar_of(c.shown.type).is_float]
            fix = nearest(whole, floats) or (f"such as `{floats[0]}`" if floats else "the controllers have none")
            sink.error("E210", f"there is no parameter `{whole}` of a controller", span, help=fix)
            continue
        type_, shape = parameter.shown.type, shape_of(parameter.shown.type)
        place = row_major_index(index, shape)
        if place is None or len(index) < len(shape):
            fix = name_an_element(whole, shape)
            sink.error("E217", f"`{whole}` is {type_}; scalars are tuned", span, help=fix)
            continue
        if not scalar_of(type_).is_float:
            sink.error("E217", f"`{path}` is {scalar_of(type_).name}; floating numbers are tuned", span)
            continue
        target = *parameter.target, str(place)
        if target in dispersed.values():
            fix = "remove it from one of them"
            sink.error("E213", f"`{path}` is tuned, and differs from case to case", span, help=fix)
        elif parameter.is_settable(path, span, sink):
            ends = _bounds(member.value, path, parameter, reader)
            if ends is not None:
                found.append(Tuned(path, parameter.shown, target, *ends))
    return tuple(found)


def _bounds(
    node: JsonNode, path: str, parameter: ControllerParameter, reader: ConfigReader
) -> tuple[float, float] | None:
    """`within`, or the range that the algorithm declares."""
    keys = reader.object(node, f"`{path}`", (), ("within",))
    if keys is None:
        return None
    if "within" not in keys:
        low, high = parameter.field.minimum, parameter.field.maximum
        if math.isinf(low) or math.isinf(high):
            why = (
                f"the algorithm declares {parameter.range_text}" if parameter.field.bounded else "no range is declared"
            )
            reader.sink.error("E202", f"`{path}` has no bounds", node.span, why=why, help=f"write {_EXAMPLE}")
            return None
        return low, high
    within = keys["within"]
    ends = [reader.number(item, "a bound", -1e300, 1e300) for item in reader.list(within, "`within`")]
    if within.kind == "array" and len(ends) != 2:
        reader.sink.error(
            "E207", "`within` is a list of the least and the greatest value", within.span, help="write […, …]"
        )
    if len(ends) != 2 or ends[0] is None or ends[1] is None:
        return None
    if not ends[0] < ends[1]:
        reader.sink.error("E204", f"{ends[0]:g} is not below {ends[1]:g}", within.span)
        return None
    return (ends[0], ends[1]) if parameter.is_in_range(ends, path, within.span, reader.sink) else None


def _cases(node: JsonNode | None, reader: ConfigReader, study_cases: int) -> int | None:
    cases = reader.integer(node, "`cases` of `tune`", 1, 10_000_000)
    if cases is not None and node is not None and cases >= study_cases:
        why = "the cases behind those judge the result: it is not tuned to them"
        fix = f"fewer than {study_cases}, or more `cases` of the study"
        reader.sink.error("E204", f"all {study_cases} cases of the study would tune", node.span, why=why, help=fix)
        return None
    return cases


def _minimise(
    node: JsonNode | None, reader: ConfigReader, metrics: Mapping[str, Metric], machine: Machine
) -> Metric | None:
    text = reader.string(node, "`minimise`", "settling + 0.1 * overshoot")
    if text is None or node is None:
        return None
    try:
        found = Metric(text, machine, metrics)
    except MetricError as error:
        reader.sink.error("E208", f"`minimise`: {error}", node.span)
        return None
    if found.paths:
        fix = f'write it as a metric: "metrics": {{"cost": "{text}"}}, "minimise": "cost"'
        reader.sink.error("E208", f"`minimise` reads `{min(found.paths)}` itself", node.span, help=fix)
        return None
    return found
