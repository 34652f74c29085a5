# SPDX-License-Identifier: Apache-2.0
"""Which models integrate together, and in which order models are evaluated at an instant.

A model has up to three steps in that order: its outputs that depend on no input of the instant (`FREE`), those that do
(`THROUGH`), and its update. Both kinds of outputs are one call of `output`; a model is called twice only where a loop
through it is no algebraic loop, because it closes by an output without feed-through.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fcsl_compiler.api.diagnostics import Span

from .models import ModelField, ModelTable

FREE, THROUGH, UPDATE = "free", "through", "update"
#: A step of an instance, as (kind, instance).
Step = tuple[str, str]


@dataclass(frozen=True)
class Link:
    """A connection between two models."""

    source: str
    output: ModelField
    target: str
    input: ModelField
    span: Span


@dataclass(frozen=True)
class Call:
    """`kind` is output, stage (an output that derivatives or events need) or update."""

    instance: str
    kind: str


class AlgebraicLoop(Exception):
    """Outputs that depend on each other at one instant; `links` close a circle."""

    def __init__(self, links: Sequence[Link]):
        super().__init__("algebraic loop")
        self.links = tuple(links)


def groups(tables: Mapping[str, ModelTable], links: Sequence[Link]) -> list[list[str]]:
    """Models that are directly connected, as far as one of them is integrated or has events. Sorted by name.

    An output that `update` writes holds between two updates, and an input that only `update` reads is read then: such
    connections are sampled, and join no group.
    """
    leader = {name: name for name in tables}

    def find(name: str) -> str:
        while leader[name] != name:
            name = leader[name]
        return name

    for link in links:
        if tables[link.source].has_output and tables[link.target].has_output:
            first, second = sorted((find(link.source), find(link.target)))
            leader[second] = first
    found: dict[str, list[str]] = {}
    for name in sorted(tables):
        found.setdefault(find(name), []).append(name)
    return [group for group in found.values() if any(tables[name].integrated or tables[name].events for name in group)]


def calls(tables: Mapping[str, ModelTable], links: Sequence[Link]) -> list[Call]:
    """The order of evaluation: sources before targets, ties by name. Raises AlgebraicLoop."""
    split: set[str] = set()
    while True:
        order, stuck = _sorted(tables, links, split)
        if not stuck:
            return _as_calls(tables, links, split, order)
        more = {name for _, name in stuck if _has_both(tables[name])} - split
        if not more:
            raise AlgebraicLoop(_loop(tables, links, split, stuck))
        split |= more


def _has_both(table: ModelTable) -> bool:
    kinds = {field.feedthrough for field in table.of_role("output")}
    return table.has_output and kinds == {False, True}


def _steps(name: str, table: ModelTable, split: set[str]) -> list[Step]:
    """The steps of a model, in their order."""
    through = any(field.feedthrough for field in table.of_role("output"))
    kinds = []
    if table.has_output and (not through or name in split):
        kinds.append(FREE)
    if table.has_output and through:
        kinds.append(THROUGH)
    if table.has_update:
        kinds.append(UPDATE)
    return [(kind, name) for kind in kinds]


def _provider(link: Link, tables: Mapping[str, ModelTable], split: set[str]) -> Step:
    """The step that makes the value of a connection."""
    if not tables[link.source].has_output:
        return UPDATE, link.source
    steps = _steps(link.source, tables[link.source], split)
    return (FREE, link.source) if not link.output.feedthrough and steps[0][0] == FREE else (THROUGH, link.source)


def _needs(tables: Mapping[str, ModelTable], links: Sequence[Link], split: set[str]) -> dict[Step, set[Step]]:
    """What comes before each step."""
    needs: dict[Step, set[Step]] = {}
    for name, table in tables.items():
        steps = _steps(name, table, split)
        sources = {_provider(link, tables, split) for link in links if link.target == name}
        for i, step in enumerate(steps):
            needs[step] = set(steps[:i]) | (sources if step[0] != FREE else set())
    return needs


def _wishes(tables: Mapping[str, ModelTable], links: Sequence[Link], split: set[str]) -> dict[Step, set[Step]]:
    """What comes before each step where no circle of updates forbids it: of a model that has `output` and `update`, an output may
    be made by either, so what it feeds follows the update. (What `output` made before stays as it is.)"""
    wishes: dict[Step, set[Step]] = {}
    for link in links:
        source = tables[link.source]
        if source.has_output and source.has_update and link.source != link.target:
            for step in _steps(link.target, tables[link.target], split):
                if step[0] == UPDATE:
                    wishes.setdefault(step, set()).add((UPDATE, link.source))
    return wishes


def _sorted(tables: Mapping[str, ModelTable], links: Sequence[Link], split: set[str]) -> tuple[list[Step], set[Step]]:
    """Topological order, and the steps that have none."""
    needs, wishes = _needs(tables, links, split), _wishes(tables, links, split)
    while True:
        order, stuck = _topological({step: needs[step] | wishes.get(step, set()) for step in needs})
        refused = [step for step in stuck if step in wishes]
        if not refused:
            return order, stuck
        for step in refused:
            del wishes[step]


def _topological(needs: Mapping[Step, set[Step]]) -> tuple[list[Step], set[Step]]:
    """The steps in order, ties by name; and those on a circle or behind one."""
    feeds: dict[Step, set[Step]] = {step: set() for step in needs}
    for step, sources in needs.items():
        for source in sources:
            feeds[source].add(step)
    waiting = {step: len(sources) for step, sources in needs.items()}
    ready = [(step[1], step[0]) for step, count in waiting.items() if count == 0]
    heapq.heapify(ready)
    order: list[Step] = []
    while ready:
        name, kind = heapq.heappop(ready)
        order.append((kind, name))
        for target in feeds[kind, name]:
            waiting[target] -= 1
            if waiting[target] == 0:
                heapq.heappush(ready, (target[1], target[0]))
    return order, set(needs) - set(order)


def _loop(tables: Mapping[str, ModelTable], links: Sequence[Link], split: set[str], stuck: set[Step]) -> list[Link]:
    """Follows sources backwards until a model repeats, which closes a loop."""
    path: list[Link] = []
    seen: list[str] = []
    at = {link for link in links if link.target in {name for _, name in stuck}}
    feeding = [link for link in at if _provider(link, tables, split) in stuck]
    feeding.sort(key=lambda link: (link.target, link.source, link.input.path))
    name = feeding[0].target
    while name not in seen:
        seen.append(name)
        link = next(link for link in feeding if link.target == name)
        path.append(link)
        name = link.source
    return path[seen.index(name) :][::-1]


def _as_calls(
    tables: Mapping[str, ModelTable], links: Sequence[Link], split: set[str], order: Sequence[Step]
) -> list[Call]:
    """Stages are the outputs within a group from which an integrated model, or one with events, has an input."""
    member = {name: i for i, group in enumerate(groups(tables, links)) for name in group}
    inner = [
        link
        for link in links
        if link.source in member and member.get(link.target) == member[link.source] and tables[link.source].has_output
    ]
    stages: set[Step] = set()
    wanted = [name for name, table in tables.items() if table.integrated or table.events]
    while wanted:
        target = wanted.pop()
        for link in inner:
            step = _provider(link, tables, split)
            if link.target == target and step not in stages:
                stages.add(step)
                if step[0] == THROUGH:
                    wanted.append(link.source)
    kinds = {FREE: "output", THROUGH: "output", UPDATE: "update"}
    return [Call(name, "stage" if (kind, name) in stages else kinds[kind]) for kind, name in order]
