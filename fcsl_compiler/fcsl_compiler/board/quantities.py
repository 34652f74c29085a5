# SPDX-License-Identifier: Apache-2.0
"""Objects from quantity to something: channels, signals, corrections, limits, filters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..base.diagnostics import nearest
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .kinds import KINDS, Quantity


@dataclass(frozen=True)
class Subset:
    """The quantities of a kind that one key may name. `where` says which ones, in messages."""

    kind: str
    where: str
    quantities: tuple[Quantity, ...]


def all_of(kind: str) -> Subset:
    return Subset(kind, "has", KINDS[kind])


def measured(kind: str) -> Subset:
    return Subset(kind, "measures", tuple(q for q in KINDS[kind] if q.measured))


def adjustable(kind: str) -> Subset:
    return Subset(kind, "can correct or filter", tuple(q for q in KINDS[kind] if q.adjustable))


def by_quantity(
    node: JsonNode | None, what: str, subset: Subset, reader: ConfigReader
) -> Iterator[tuple[Quantity, JsonNode]]:
    """Each known quantity with its value, in the order of the file. Reports the others."""
    if node is None:
        return
    if node.kind != "object":
        reader.wrong(node, f"{what} is an object from quantity to value", '{"…": …}')
        return
    names = [q.name for q in subset.quantities]
    for key, member in node.members.items():
        if key in names:
            yield subset.quantities[names.index(key)], member.value
            continue
        hint = nearest(key, names) or (f"there are {', '.join(names)}" if names else "there are none")
        message = f"`{key}` in {what} is no quantity that a sensor of kind `{subset.kind}` {subset.where}"
        reader.sink.error("E506", message, member.key_span, help=hint)
