# SPDX-License-Identifier: Apache-2.0
"""What `fcsl models` and `fcsl describe` print of models, for people and for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from fcsl_compiler.api.types import Type, scalar_of, shape_of

from .errors import SimError
from .model_list import Found
from .models import ModelField, ModelTable

_ROLES = {"input": "inputs", "output": "outputs", "parameter": "parameters", "state": "states"}


def list_text(models: Sequence[Found]) -> str:
    """Two lines for each model: what it is, and the member of `models` that names it."""
    lines = []
    for model in models:
        lines.append(f"{model.name}: {_doc_of(model)}")
        lines.append(f"  {json.dumps(model.name)}: {json.dumps(model.definition)}")
    return "\n".join(lines)


def list_json(models: Sequence[Found]) -> list[dict[str, Any]]:
    """name, model (as in `models`), path and doc of each; `problem` in place of doc where it cannot be used."""
    listed: list[dict[str, Any]] = []
    for model in models:
        entry: dict[str, Any] = {"name": model.name, "model": model.definition, "path": str(model.path)}
        try:
            entry["doc"] = model.table().doc
        except SimError as error:
            entry["problem"] = str(error)
        listed.append(entry)
    return listed


def _doc_of(model: Found) -> str:
    try:
        return model.table().doc or "(no documentation)"
    except SimError:
        return f"cannot be used; `fcsl describe {model.path}` says why"


def describe_json(model: Found, table: ModelTable) -> dict[str, Any]:
    """Everything of a model's descriptor, and a skeleton of a simulation file."""
    integrated = table.continuous()
    return {
        "name": table.name,
        "doc": table.doc,
        "model": model.definition,
        "path": str(model.path),
        "continuous_states": table.continuous_count,
        "second_order": table.second_order,
        "has_output": table.has_output,
        "has_update": table.has_update,
        "fields": [
            {
                "path": field.path,
                "role": field.role,
                "type": scalar_of(field.type).name,
                "shape": list(shape_of(field.type)),
                "unit": field.unit,
                "doc": field.doc,
                "feedthrough": field.feedthrough,
                "optional": field.optional,
                "table": field.table,
                "integrated": field.path in integrated,
            }
            for field in table.fields.values()
        ],
        "events": [{"name": e.name, "crossing": e.crossing, "doc": e.doc} for e in table.events],
        "skeleton": skeleton(model, table),
    }


def describe_text(model: Found, table: ModelTable) -> str:
    """A page: what the model is, a table of its fields and events, and the skeleton of a simulation file."""
    lines = [f"{table.name}: {table.doc}", *_facts(table)]
    integrated = table.continuous()
    for role, title in _ROLES.items():
        fields = table.of_role(role)
        if fields:
            lines += ["", title, *_columns([_row(field, field.path in integrated) for field in fields])]
    if table.events:
        lines += ["", "events", *_columns([[e.name, e.crossing, e.doc] for e in table.events])]
    return "\n".join([*lines, "", *_members(skeleton(model, table))])


def _facts(table: ModelTable) -> list[str]:
    facts = []
    if table.continuous_count:
        order = ", of second order (for `verlet`)" if table.second_order else ""
        plural = "s" if table.continuous_count > 1 else ""
        facts.append(f"  integrated: {table.continuous_count} continuous state{plural}{order}")
    if table.has_update:
        facts.append("  updated at its rate in `rates`")
    if table.has_output and any(field.feedthrough for field in table.of_role("output")):
        facts.append("  feed-through: outputs that depend on inputs of the same instant")
    return facts


def _row(field: ModelField, is_integrated: bool) -> list[str]:
    marks = {
        "feed-through": field.feedthrough,
        "optional": field.optional,
        "table": field.table,
        "integrated": is_integrated,
    }
    mark = next((name for name, holds in marks.items() if holds), "")
    return [field.name, str(field.type), field.unit, mark, field.doc]


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True) if width]
        lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


def skeleton(model: Found, table: ModelTable) -> dict[str, Any]:
    """Members of a simulation file with one instance of the model: every parameter is 0, a table one value, and the rate 100 Hz."""
    instance: dict[str, Any] = {"model": table.name}
    parameters = {f.name: [0.0] if f.table else _zero(f.type) for f in table.of_role("parameter")}
    if parameters:
        instance["parameters"] = parameters
    members: dict[str, Any] = {"models": {table.name: model.definition}, "instances": {table.name: instance}}
    return members | ({"rates": {table.name: 100}} if table.has_update else {})


def _zero(type_: Type) -> Any:
    scalar = scalar_of(type_)
    value: Any = False if scalar.name == "bool" else 0.0 if scalar.is_float else 0
    for extent in reversed(shape_of(type_)):
        value = [value] * extent
    return value


def _members(value: dict[str, Any]) -> list[str]:
    """The members of an object as JSON, without its braces, to paste between others."""
    return [line.removeprefix("  ") for line in json.dumps(value, indent=2).splitlines()[1:-1]]
