# SPDX-License-Identifier: Apache-2.0
"""Text form of the facts of facts.py."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence

from ..driver.stack import LEAF_BYTES
from ..emit.operations import KINDS
from ..model.machine import split_instance
from .facts import Facts

_MEASURED = ("own_instructions", "usual_instructions", "instructions", "code_bytes", "record_bytes", "rollback_bytes")
_SHORT = {"multiply": "mul", "divide": "div", "compare": "cmp", "convert": "conv", "branch": "br"}


def report_text(facts: Facts) -> str:
    """Report of one machine, ending in a newline."""
    out = [f"== {facts['machine']}, {facts['tick_hz']} Hz"]
    out += _sizes(facts)
    out += ["", *_instances(facts), *_math(facts["math"])]
    estimates = {f["function"] for f in facts["math"] if f["estimate"]}
    estimated = {i["name"]: estimates & set(i["math"]) for i in facts["instances"]}
    for state in facts["states"]:
        found = {name for entry in state["order"] for name in estimated[entry["instance"]]}
        out += ["", *_state(state, sorted(found), estimated)]
    return "\n".join(out) + "\n"


def _sizes(facts: Facts) -> list[str]:
    stack = "not known from this C compiler"
    if facts["stack_bytes"] is not None:
        stack = f"{facts['stack_bytes']} bytes ({LEAF_BYTES} assumed where it calls libc or libm), without externs"
    out = [f"stack of a step: {stack}"]
    if facts["why_no_code"]:
        return [*out, f"instructions and sizes: not known, {facts['why_no_code']}"]
    sizes = (
        f"{facts['struct_bytes']} bytes of state, {facts['code_bytes']} of code, {facts['constant_bytes']} of constants"
    )
    return [*out, f"{sizes}, {facts['descriptor_bytes']} used only by hosts"]


def _instances(facts: Facts) -> list[str]:
    rows = [
        [
            "instance",
            "own instr.",
            "usual math",
            "worst math",
            "code B",
            "record B",
            "rollback B",
            *(_SHORT.get(k, k) for k in KINDS),
            "functions",
        ]
    ]
    notes = []
    rows += [_instance(name, of) for name, of in _with_parts(facts["instances"])]
    for i in facts["instances"]:
        if i["why_no_bound"]:
            notes.append(f"  {i['name']}: no instruction bound: {i['why_no_bound']}")
        if i["apart"]:
            notes.append(f"  {i['name']}: not counted: {', '.join(i['apart'])}")
    return [*_table(rows), *notes]


def _instance(name: str, of: Sequence[Facts]) -> list[str]:
    """A row of the table: of one instance, or the sums of a part's."""
    sums: Counter[str] = Counter()
    functions: Counter[str] = Counter()
    for i in of:
        sums.update({k: i["operations"][k] for k in KINDS})
        functions.update(i["operations"]["functions"])
    measured = [_or_dash(None if any(i[k] is None for i in of) else sum(i[k] for i in of)) for k in _MEASURED]
    return [name, *measured, *(str(sums[k]) for k in KINDS), " ".join(f"{n}·{name}" for name, n in functions.items())]


def _with_parts(instances: Sequence[Facts]) -> Iterator[tuple[str, Sequence[Facts]]]:
    """Each instance, and before the first one of a part all of the part's."""
    seen = set()
    for i in instances:
        words = i["name"].split(".")
        for part in (".".join(words[:n]) for n in range(1, len(words))):
            if part not in seen:
                seen.add(part)
                of = [other for other in instances if other["name"].startswith(f"{part}.")]
                yield f"{part} ({_count(len(of), 'instance')})", of
        yield i["name"], [i]


def _math(functions: list[Facts]) -> list[str]:
    """Cost of a call of each function."""
    if not functions:
        return []
    rows = [["math call", "usual", "at most"]]
    rows += [
        [f["function"], str(f["usual"]), str(f["most"]), "estimate: not proven" if f["estimate"] else ""]
        for f in functions
    ]
    return ["", *_table([[*row, ""][:4] for row in rows])]


def _tick(state: Facts, estimates: list[str]) -> str:
    bound, own = state["instructions"], state["own_instructions"]
    if bound is None:
        return "no instruction bound of its tick"
    text = f"a tick takes at most {own} instructions without library calls"
    if bound == own:
        return text
    text += f", {state['usual_instructions']} with usual math calls, {bound} with the slowest"
    return text + (f" (an estimate, for {', '.join(estimates)})" if estimates else "")


def _state(state: Facts, estimates: list[str], instances: Collection[str]) -> list[str]:
    cycle = state["major_cycle_ticks"]
    code = f", {state['code_bytes']} bytes of code" if state["code_bytes"] is not None else ""
    out = [f"state {state['name']}: {_tick(state, estimates)}{code}; it repeats every {_count(cycle, 'tick')}"]
    if state["why_no_slots"]:
        out.append(f"  {state['why_no_slots']}: the bound assumes that all instances are due")
    if state["why_no_bound"]:
        out.append(f"  because {state['why_no_bound']}")
    out.append("  order: " + (", ".join(map(_due, state["order"])) or "nothing runs"))
    out += _load(state) if state["slots"] is not None and cycle > 1 else []
    out += _latencies(state, instances)
    return out + _levelling(state["levelling"])


def _due(entry: Facts) -> str:
    if entry["divisor"] == 1:
        return str(entry["instance"])
    return f"{entry['instance']} (every {entry['divisor']}, from {entry['phase']})"


def _load(state: Facts) -> list[str]:
    rows = [["  ticks", "first", "load", "bound of the tick", "due"]]
    for slot in sorted(state["slots"], key=lambda s: (-(s["load"] or 0), s["first"])):
        figures = [str(slot["ticks"]), str(slot["first"]), _or_dash(slot["load"]), _or_dash(slot["instructions"])]
        rows.append([f"  {figures[0]}", *figures[1:], " ".join(slot["due"]) or "-"])
    return _table(rows)


def _latencies(state: Facts, instances: Collection[str]) -> list[str]:
    """Latencies of connections. Connections with the same latency between the same two instances share a line."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for c in state["connections"]:
        instance, field = split_instance(c["from"], instances)
        source = c["from"] if instance in ("machine", "channels") else instance
        target, _ = split_instance(c["to"], instances)
        groups.setdefault((source, target, _age(c["latency_ticks"])), []).append(field)
    rows = [[f"  {source} → {target}", age, " ".join(fields)] for (source, target, age), fields in groups.items()]
    return ["  latency, ticks", *_table(rows)] if rows else []


def _age(ticks: Sequence[int] | None) -> str:
    if ticks is None:
        return "held"
    return str(ticks[0]) if ticks[0] == ticks[1] else f"{ticks[0]}..{ticks[1]}"


def _levelling(found: Facts | None) -> list[str]:
    if found is None:
        return []
    phases = ", ".join(f'{name} `"phase": {phase}`' for name, phase in found["phases"].items())
    out = [f"  peak load: {found['peak_before']}; {found['peak_after']} with {phases}"]
    out += [
        f"    then {c['from']} → {c['to']}: {_age(c['before'])} → {_age(c['after'])} ticks"
        for c in found["latency_ticks"]
    ]
    return out


def _count(n: int, noun: str) -> str:
    return noun if n == 1 else f"{n} {noun}s"


def _or_dash(value: int | None) -> str:
    return "-" if value is None else str(value)


def _table(rows: list[list[str]]) -> list[str]:
    """A table with minimal column widths and right-aligned numbers."""
    widths = [max(len(row[n]) for row in rows) for n in range(len(rows[0]))]
    out = []
    for row in rows:
        cells = [c.rjust(w) if c.isdigit() or c == "-" else c.ljust(w) for c, w in zip(row, widths, strict=True)]
        out.append("  ".join(cells).rstrip())
    return out
