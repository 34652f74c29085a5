# SPDX-License-Identifier: Apache-2.0
"""Transitions and requests of the machine JSON."""

from __future__ import annotations

from ..base.diagnostics import nearest
from ..base.source import Span
from ..model.machine import Edge, Instance, unknown_instance
from ..model.types import HEALTH_NAMES
from ..parse.json_reader import ConfigReader, RequestUse, is_name
from ..parse.json_source import JsonNode
from .states import MAX_TICKS
from .times import read_ticks


def read_transitions(
    keys: dict[str, JsonNode],
    tick_hz: int,
    states: list[str],
    instances: list[Instance],
    incomplete: set[str],
    reader: ConfigReader,
) -> tuple[list[str], list[Edge]]:
    """Request names (JSON order, then `requests`), and the edges, one per source state, by falling priority."""
    requests: list[str] = []
    edges: list[Edge] = []
    unranked: set[Span] = set()
    readable = True  # False if a request name could not be read: it may be the one that an algorithm uses
    if not any(key in keys and (keys[key].kind != "array" or keys[key].items) for key in ("transitions", "requests")):
        return _own_requests(instances, reader), []
    for key in ("transitions", "requests"):
        readable &= key not in keys or keys[key].kind == "array"
    for item in reader.list(keys.get("transitions"), "`transitions`"):
        if item.get("priority") is None:
            unranked.add(item.span)
        request = _request(item, requests, reader)
        readable &= request is not None
        edges += _edge(item, request, tick_hz, states, [i.name for i in instances], incomplete, reader)
    for item in reader.list(keys.get("requests"), "`requests`"):
        name = reader.string(item, "a request")
        if name is None or not _valid_request(name, item.span, reader):
            readable = False
        elif name not in requests:
            requests.append(name)
    _check_priorities(edges, unranked, states, reader)
    _check_requests(instances, requests, readable, reader)
    edges.sort(key=lambda e: (e.source, -e.priority))
    return requests, edges


def _named_requests(instances: list[Instance], reader: ConfigReader) -> dict[str, RequestUse]:
    """All requests that algorithms or JSON values name, with their first use."""
    named: dict[str, RequestUse] = {}
    for instance in instances:
        part = instance.name.rpartition(".")[0]
        for name, span in instance.algorithm.requests:
            named.setdefault(name, RequestUse(span, part, instance.name))
    return {**named, **{name: use for name, use in reader.requests.items() if name not in named}}


def _bindings(name: str, use: RequestUse, reader: ConfigReader) -> list[tuple[Span, str]]:
    """Where a request of a part gets its name, from inside out."""
    scopes = {source.part: scope for source, scope in reader.scopes.items()}
    found, part = [], use.part
    while part:
        for own in (own for own, whole in scopes[part].requests.items() if whole == name):
            text = f"`{use.instance or part}` makes it: `{own}` of part `{part}` is called so here"
            found.append((scopes[part].named[own], text))
        part = part.rpartition(".")[0]
    return found


def _own_requests(instances: list[Instance], reader: ConfigReader) -> list[str]:
    """Requests of a machine without `transitions` and `requests`, such as the fixture of a unit test: those its
    algorithms name."""
    named = _named_requests(instances, reader)
    requests = [name for name, use in named.items() if _valid_request(name, use.span, reader)]
    if requests:
        why = "without `transitions` and `requests`, the names in algorithms are not checked"
        listed = ", ".join(f'"{name}"' for name in requests)
        names = ", ".join(f"`{name}`" for name in requests)
        message = f"no list shows whether there {'is a request' if len(requests) == 1 else 'are requests'} {names}"
        at = named[requests[0]].span
        notes = [note for name in requests for note in _bindings(name, named[name], reader)]
        reader.sink.warning("W208", message, at, why=why, help=f'list it: `"requests": [{listed}]`', notes=notes)
    return requests


def _valid_request(name: str, span: Span, reader: ConfigReader) -> bool:
    if is_name(name) and name != "none":
        return True
    if name == "none":
        fix = 'no request is the empty string, `""`, in an algorithm'
        reader.sink.error("E203", "in C, `none` means no request", span, help=fix)
        return False
    fix = "letters, digits and single underscores between them, such as START_COAST"
    reader.sink.error("E203", f"`{name}` is not a request name", span, help=fix)
    return False


_EDGE_KEYS = ("from", "to", "request", "priority", "health", "requirement", "after_s", "description")


def _request(item: JsonNode, requests: list[str], reader: ConfigReader) -> int | None:
    """Index of an edge's request; a new name is appended. -1 without a request, None after an error."""
    if item.kind != "object":
        return None
    node = item.get("request")
    if node is None:  # a misspelt key may stand for `request`
        return -1 if item.members.keys() <= set(_EDGE_KEYS) else None
    name = reader.string(node, "`request`")
    if name is None or not _valid_request(name, node.span, reader):
        return None
    if name not in requests:
        requests.append(name)
    return requests.index(name)


def _edge(
    item: JsonNode,
    request: int | None,
    tick_hz: int,
    states: list[str],
    instances: list[str],
    incomplete: set[str],
    reader: ConfigReader,
) -> list[Edge]:
    keys = reader.object(item, "a transition", _EDGE_KEYS[:2], _EDGE_KEYS[2:])
    if keys is not None:
        reader.string(keys.get("description"), "`description`")
    if keys is None or request is None or "from" not in keys or "to" not in keys:
        return []
    target = reader.reference(keys["to"], "state", states)
    guard_instance, guard_mask = -1, 0
    if "health" in keys:
        guard = _guard(keys["health"], instances, incomplete, reader)
        if guard is None:
            return []
        guard_instance, guard_mask = guard
    requirement = reader.string(keys.get("requirement"), "`requirement`", "LND-7") or ""
    if "health" in keys and "requirement" in keys:
        fix = "remove `health`, and name it in a condition of the requirement"
        reader.sink.error("E257", "a transition with `health` and `requirement`", keys["requirement"].span, help=fix)
        return []
    after_ticks = 0
    if "after_s" in keys:
        time = read_ticks(
            keys["after_s"], "after_s", tick_hz, MAX_TICKS, "a state lasts a whole number of ticks", reader
        )
        if time is None:
            return []
        after_ticks = time
    if request < 0 and guard_instance < 0 and "requirement" not in keys and not after_ticks:
        fix = 'add `"request": "…"`, `"health": {…}`, `"requirement": "…"` or `"after_s": …`'
        reader.sink.error("E221", "an edge without request, guard or time", item.span, help=fix)
        return []
    priority = reader.integer(keys.get("priority"), "`priority`", -(2**31), 2**31 - 1)
    if target is None or (priority is None and "priority" in keys):
        return []
    return [
        Edge(source, target, request, priority or 0, guard_instance, guard_mask, after_ticks, item.span, requirement)
        for source in _sources(keys["from"], states, target, reader)
    ]


def _sources(node: JsonNode, states: list[str], target: int, reader: ConfigReader) -> list[int]:
    if node.kind == "string" and node.value == "*":
        if states == [states[target]]:
            fix = "remove this transition, or add its source state"
            reader.sink.warning(
                "W205", f'"*" denotes no state: `{states[target]}` is the only one', node.span, help=fix
            )
        return [i for i in range(len(states)) if i != target]
    items = node.items if node.kind == "array" else [node]
    if not items:
        reader.sink.error("E223", "an edge from no state", node.span, help='name states, or write "*" for every other')
    sources: dict[int, Span] = {}
    for item in items:
        index = reader.reference(item, "state", states)
        if index is None:
            continue
        if index == target:
            fix = "an edge leads to another state"
            reader.sink.error("E222", f"an edge from `{states[index]}` to itself", item.span, help=fix)
        elif index in sources:
            notes = [(sources[index], "first here")]
            reader.sink.error("E223", f"`{states[index]}` is listed twice", item.span, help="remove one", notes=notes)
        else:
            sources[index] = item.span
    return list(sources)


def _guard(node: JsonNode, instances: list[str], incomplete: set[str], reader: ConfigReader) -> tuple[int, int] | None:
    keys = reader.object(node, "`health`", ("instance", "in"))
    if keys is None or "instance" not in keys or "in" not in keys:
        return None
    if keys["instance"].kind == "string" and keys["instance"].value in incomplete:
        return None
    instance = _guarded(keys["instance"], instances, reader)
    mask = 0
    for item in reader.list(keys["in"], "`in`"):
        health = reader.choice(item, "a health", HEALTH_NAMES)
        if health is not None:
            mask |= 1 << HEALTH_NAMES.index(health)
    if keys["in"].kind == "array" and not keys["in"].items:
        reader.sink.error(
            "E221", "a guard that is never true", keys["in"].span, help=f"list one of {', '.join(HEALTH_NAMES)}"
        )
    return (instance, mask) if instance is not None and mask else None


def _guarded(node: JsonNode, instances: list[str], reader: ConfigReader) -> int | None:
    """Index of the instance that a guard names."""
    name = reader.string(node, "an instance")
    if name is None or name in instances:
        return instances.index(name) if name is not None else None
    message, fix = unknown_instance(name, instances)
    reader.sink.error("E206", message, node.span, help=fix)
    return None


def _check_priorities(edges: list[Edge], unranked: set[Span], states: list[str], reader: ConfigReader) -> None:
    """Checks that the edges of each state have distinct priorities. At most one edge is then taken, and the choice is
    unambiguous."""
    reported: set[tuple[Span, ...]] = set()  # a transition from several states is reported once
    for source, name in enumerate(states):
        leaving = [e for e in edges if e.source == source]
        groups: dict[int | None, list[Edge]] = {}
        for edge in leaving if len(leaving) > 1 else []:
            groups.setdefault(None if edge.span in unranked else edge.priority, []).append(edge)
        for priority, group in groups.items():
            spans = tuple(e.span for e in group)
            if (priority is not None and len(group) == 1) or spans in reported:
                continue
            reported.add(spans)
            if priority is None:
                problem = "has no priority, but its state has several edges"
                others = [
                    (e.span, "has none either" if e in group else "another edge") for e in leaving if e is not group[0]
                ]
            else:
                problem = f"has the same priority ({priority}) as another"
                others = [(e.span, "the other edge") for e in group[:-1]]
            reader.sink.error(
                "E224",
                f"this edge of state `{name}` {problem}",
                group[0 if priority is None else -1].span,
                why="if both are true in one tick, the larger priority is taken",
                help='give each edge a different `"priority": …`',
                notes=others,
            )


def _check_requests(instances: list[Instance], requests: list[str], readable: bool, reader: ConfigReader) -> None:
    """Checks that every request in an algorithm is declared."""
    for name, use in _named_requests(instances, reader).items():
        if name not in requests and readable:
            hint = nearest(name.removeprefix("tr_"), requests)
            fix = hint or f'add a transition with it, or list it: `"requests": ["{name}"]`'
            message = f"no transition is requested by `{name[:40]}`"
            reader.sink.error("E225", message, use.span, help=fix, notes=_bindings(name, use, reader))
