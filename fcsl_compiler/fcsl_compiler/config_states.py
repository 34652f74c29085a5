# SPDX-License-Identifier: Apache-2.0
"""States, schedules and transitions of the machine JSON."""

from __future__ import annotations

from .config_reader import ConfigReader, is_name
from .diagnostics import nearest
from .json_source import JsonNode
from .machine import Edge, Entry, Instance, State
from .source import Span
from .types import HEALTH_NAMES

_MAX_PERIOD_TICKS = 1 << 40


def read_states(
    node: JsonNode | None, tick_hz: int, instances: list[str], incomplete: set[str], reader: ConfigReader
) -> list[State]:
    """Every state with its due instances, in JSON order."""
    states: list[State] = []
    for name, (definition, span) in reader.named(node, "`states`").items():
        keys = reader.object(definition, f"state `{name}`", ("schedule",), ("description",)) or {}
        reader.string(keys.get("description"), "`description`")
        entries: list[Entry] = []
        for instance, (rate, at) in reader.named(keys.get("schedule"), f"the schedule of `{name}`").items():
            if instance not in instances and instance not in incomplete:
                hint = nearest(instance, instances) or f"the instances are {', '.join(instances) or 'none'}"
                reader.sink.error("E206", f"no instance `{instance}`", at, help=hint)
                continue
            timing = _rate(rate, tick_hz, reader) if tick_hz else None
            if timing is not None and instance not in incomplete:
                entries.append(Entry(instances.index(instance), timing[0], timing[1], at))
        order = sorted(entries, key=lambda e: e.instance)
        states.append(State(name, tuple(order), span))
    if node is not None and node.kind == "object" and not states:
        fix = 'a machine that only runs has one: "states": {"RUN": {"schedule": {…}}}'
        reader.sink.error("E219", "a machine has at least one state", node.span, help=fix)
    return states


def _rate(node: JsonNode, tick_hz: int, reader: ConfigReader) -> tuple[int, int] | None:
    """(divisor, phase) of `100`, `{"hz": 100, "phase": 3}` or `{"every": 2000}`."""
    phase_node: JsonNode | None = None
    if node.kind == "object":
        timed = "every" if node.get("every") is not None else "hz"
        keys = reader.object(node, "a rate", (timed,), ("phase",))
        if keys is None or timed not in keys:
            return None
        phase_node = keys.get("phase")
        if timed == "every":
            divisor = reader.integer(keys["every"], "`every` (ticks)", 1, _MAX_PERIOD_TICKS)
        else:
            divisor = _divisor(keys["hz"], tick_hz, reader)
    else:
        divisor = _divisor(node, tick_hz, reader)
    if divisor is None:
        return None
    phase = 0
    if phase_node is not None:
        given = reader.integer(phase_node, "`phase` (ticks)", 0, divisor - 1)
        if given is None:
            return None
        phase = given
    return divisor, phase


def _divisor(node: JsonNode, tick_hz: int, reader: ConfigReader) -> int | None:
    hz = reader.integer(node, "a rate (Hz)", 1, tick_hz)
    if hz is None:
        return None
    if tick_hz % hz:
        near = [r for r in (max(d for d in range(1, hz + 1) if tick_hz % d == 0),) if r]
        above = next((d for d in range(hz, tick_hz + 1) if tick_hz % d == 0), tick_hz)
        fix = f"the nearest rates that do are {near[0]} and {above} Hz"
        reader.sink.error("E220", f"{hz} Hz does not divide tick_hz ({tick_hz})", node.span, help=fix)
        return None
    return tick_hz // hz


def read_transitions(
    keys: dict[str, JsonNode],
    states: list[str],
    instances: list[Instance],
    incomplete: set[str],
    reader: ConfigReader,
) -> tuple[list[str], list[Edge]]:
    """Request names (JSON order, then `requests`) and one edge per source state, by falling priority."""
    requests: list[str] = []
    edges: list[Edge] = []
    unranked: set[Span] = set()
    readable = True  # every request's name; else a request in an algorithm may be one that could not be read
    for key in ("transitions", "requests"):
        readable &= key not in keys or keys[key].kind == "array"
    for item in reader.list(keys.get("transitions"), "`transitions`"):
        if item.get("priority") is None:
            unranked.add(item.span)
        request = _request(item, requests, reader)
        readable &= request is not None
        edges += _edge(item, request, states, [i.name for i in instances], incomplete, reader)
    for item in reader.list(keys.get("requests"), "`requests`"):
        name = reader.string(item, "a request")
        if name is None or not _valid_request(name, item.span, reader):
            readable = False
        elif name not in requests:
            requests.append(name)
    _check_priorities(edges, unranked, states, reader)
    _check_requests(instances, incomplete, requests, readable, edges, reader)
    edges.sort(key=lambda e: (e.source, -e.priority))
    return requests, edges


def _valid_request(name: str, span: Span, reader: ConfigReader) -> bool:
    if is_name(name) and name != "none":
        return True
    fix = "letters, digits and single underscores between them, such as START_COAST"
    reader.sink.error("E203", f"`{name}` is not a request name", span, help=fix)
    return False


_EDGE_KEYS = ("from", "to", "request", "priority", "health", "description")


def _request(item: JsonNode, requests: list[str], reader: ConfigReader) -> int | None:
    """Index of an edge's request, listed if it is new; -1 where it has none; None where it cannot be read."""
    if item.kind != "object":
        return None
    node = item.get("request")
    if node is None:  # a misspelt key may have meant it
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
    if request < 0 and guard_instance < 0:
        fix = 'add `"request": "…"` or `"health": {…}`'
        reader.sink.error("E221", "an edge with neither request nor health guard", item.span, help=fix)
        return []
    priority = reader.integer(keys.get("priority"), "`priority`", -(2**31), 2**31 - 1)
    if target is None or (priority is None and "priority" in keys):
        return []
    edges = []
    for source in _sources(keys["from"], states, target, reader):
        edges.append(
            Edge(source, target, request, 0 if priority is None else priority, guard_instance, guard_mask, item.span)
        )
    return edges


def _sources(node: JsonNode, states: list[str], target: int, reader: ConfigReader) -> list[int]:
    if node.kind == "string" and node.value == "*":
        if states == [states[target]]:
            fix = "remove this transition, or add the state it comes from"
            reader.sink.warning("W205", f'"*" is no state: `{states[target]}` is the only one', node.span, help=fix)
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
    instance = reader.reference(keys["instance"], "instance", instances)
    mask = 0
    for item in reader.list(keys["in"], "`in`"):
        health = reader.choice(item, "a health", HEALTH_NAMES)
        if health is not None:
            mask |= 1 << HEALTH_NAMES.index(health)
    if keys["in"].kind == "array" and not keys["in"].items:
        reader.sink.error(
            "E221", "a guard that never holds", keys["in"].span, help=f"list one of {', '.join(HEALTH_NAMES)}"
        )
    return (instance, mask) if instance is not None and mask else None


def _check_priorities(edges: list[Edge], unranked: set[Span], states: list[str], reader: ConfigReader) -> None:
    """Edges of one state are ordered by distinct priorities, so that at most one is taken and it is known which."""
    said: set[tuple[Span, ...]] = set()  # an edge from a list of states is one mistake
    for source, name in enumerate(states):
        leaving = [e for e in edges if e.source == source]
        groups: dict[int | None, list[Edge]] = {}
        for edge in leaving if len(leaving) > 1 else []:
            groups.setdefault(None if edge.span in unranked else edge.priority, []).append(edge)
        for priority, group in groups.items():
            spans = tuple(e.span for e in group)
            if (priority is not None and len(group) == 1) or spans in said:
                continue
            said.add(spans)
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
                why="when both hold in one tick, the larger priority wins",
                help='give each edge its own `"priority": …`',
                notes=others,
            )


def _check_requests(
    instances: list[Instance],
    incomplete: set[str],
    requests: list[str],
    readable: bool,
    edges: list[Edge],
    reader: ConfigReader,
) -> None:
    """Every request literal is known; every requested edge has somebody who requests it."""
    made: set[str] = set()
    for instance in instances:
        for name, span in instance.algorithm.requests:
            made.add(name)
            if name not in requests and readable:
                hint = nearest(name, requests)
                fix = hint or f'add a transition with it, or list it: `"requests": ["{name}"]`'
                reader.sink.error("E225", f"no transition is requested by `{name}`", span, help=fix)
    for edge in edges:
        if edge.request >= 0 and requests[edge.request] not in made and not incomplete:
            name = requests[edge.request]
            reader.sink.warning(
                "W202", f"no algorithm requests `{name}`", edge.span, help="only a host can take this edge"
            )
