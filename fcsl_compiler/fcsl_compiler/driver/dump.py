# SPDX-License-Identifier: Apache-2.0
"""Text form of the result of each pass, for people and golden files."""

from __future__ import annotations

import ast

from ..model import ir
from ..model.events import SEVERITIES
from ..model.machine import Machine
from ..parse.json_source import JsonNode
from ..parse.machine_files import ParsedMachine


def dump_syntax(parsed: ParsedMachine | None) -> str:
    """Values of the machine JSON by key, and the syntax tree of every algorithm."""
    assert parsed is not None
    out = [f"{key}: {_json(node)}" for key, node in parsed.keys.items()]
    for file in parsed.files:
        assert file.tree is not None
        out += [f"file {file.source.name}", ast.unparse(file.tree)]
    return "\n".join(out) + "\n"


def _json(node: JsonNode) -> str:
    if node.kind == "object":
        return "{" + ", ".join(f"{key}: {_json(m.value)}" for key, m in node.members.items()) + "}"
    if node.kind == "array":
        return "[" + ", ".join(map(_json, node.items)) + "]"
    return repr(node.value)


def dump_machine(m: Machine) -> str:
    """Instances, connections, edges and channels after name resolution."""
    out = [f"machine {m.name} at {m.tick_hz} Hz, package {m.package}, starts in {m.states[m.initial_state].name}"]
    for i in m.instances:
        out.append(f"instance {i.name}: {i.algorithm.name}")
        out += [
            f"  {record}.{p.name}: {p.type} [{p.unit}]" for record, ports in i.algorithm.ports.items() for p in ports
        ]
    for c in m.connections:
        source = m.instances[c.source.instance].name if c.source.instance >= 0 else c.source.record
        delayed = f" delayed {list(c.initial)}" if c.delayed else ""
        target = m.instances[c.target.instance].name
        out.append(f"connect {source}.{c.source.path} -> {target}.{c.target.path}{delayed}")
    for e in m.edges:
        request = m.requests[e.request] if e.request >= 0 else "-"
        guard = f" while {m.instances[e.guard_instance].name} in {e.guard_mask:04b}" if e.guard_instance >= 0 else ""
        guard += f" while {e.requirement} is violated" if e.requirement else ""
        guard += f" after {e.after_ticks} ticks" if e.after_ticks else ""
        out.append(
            f"edge {m.states[e.source].name} -> {m.states[e.target].name} on {request} priority {e.priority}{guard}"
        )
    for ch in m.channels:
        kind = f" as {ch.kind}" if ch.kind != "field" else ""
        safe = f" safe {list(ch.safe)}" if ch.safe else ""
        out.append(
            f"channel {ch.id} {ch.name} {ch.direction} {m.instances[ch.port.instance].name}.{ch.port.path}{kind}{safe}"
        )
    if m.arm is not None:
        out.append(f"arm {m.instances[m.arm.instance].name}.{m.arm.path}")
    if m.command_timeout_ns:
        out.append(f"command time-out {m.command_timeout_ns} ns")
    return "\n".join(out) + "\n"


def dump_schedule(m: Machine) -> str:
    """Execution order of every state."""
    out = []
    for state in m.states:
        out.append(f"state {state.name}")
        out += [f"  {m.instances[e.instance].name} every {e.divisor} phase {e.phase}" for e in state.entries]
    return "\n".join(out) + "\n"


def dump_types(m: Machine) -> str:
    """The type of every local, by function, in the notation of the sources."""
    reached = [*m.program.functions.values(), *(f for f, _ in m.entries)]
    found = {f.span: f for f in reached if not f.span.source.name.startswith("<")}
    out = []
    for function in sorted(found.values(), key=lambda f: f.span.key):
        arguments = ", ".join(f"{n}: {t}" for n, t in function.arguments)
        result = f" -> {function.result}" if function.result is not None else ""
        out.append(f"{function.span.source.name}:{function.span.line}: {function.source_name}({arguments}){result}")
        out += [f"  {n}: {t}" for n, t in function.locals if n.isidentifier()]
    return "\n".join(out) + "\n"


def dump_ir(m: Machine) -> str:
    """Every function of the machine."""
    functions = list(m.program.functions.values())
    functions += [f for f, _ in m.entries]
    return "\n".join(_function(f) for f in functions)


def dump_c(header: str, source: str) -> str:
    return header + "\n" + source


def _function(f: ir.Function) -> str:
    arguments = [f"{n}: {t}" for n, t in f.arguments] + list(f.records)
    out = [f"function {f.name}({', '.join(arguments)}) -> {f.result}{' faults' if f.faults else ''}"]
    out += [f"  local {n}: {t}" for n, t in f.locals]
    return "\n".join(out + _body(f.body, 1)) + "\n"


def _body(statements: tuple[ir.Stmt, ...], depth: int) -> list[str]:
    pad, out = "  " * depth, []
    for s in statements:
        if isinstance(s, ir.Assign):
            out.append(f"{pad}{expr_text(s.target)} = {expr_text(s.value)}")
        elif isinstance(s, ir.Effect):
            target = f"{expr_text(s.target)} = " if s.target is not None else ""
            out.append(f"{pad}{target}effect {s.function.name}({', '.join(map(expr_text, s.args))})")
        elif isinstance(s, ir.Event):
            values = "".join(f", {expr_text(arg)}" for arg in s.args)
            out.append(f"{pad}event {s.text!r}{values}, {SEVERITIES[s.severity]}")
        elif isinstance(s, ir.If):
            out += [f"{pad}if {expr_text(s.condition)}", *_body(s.then, depth + 1)]
            out += [f"{pad}else", *_body(s.otherwise, depth + 1)] if s.otherwise else []
        elif isinstance(s, ir.For):
            out.append(f"{pad}for {s.variable} in {expr_text(s.start)} .. {expr_text(s.stop)} step {s.step}")
            out += _body(s.body, depth + 1)
        elif isinstance(s, ir.Return):
            out.append(f"{pad}return" + (f" {expr_text(s.value)}" if s.value is not None else ""))
        else:
            out.append(pad + type(s).__name__.lower())
    return out


def expr_text(e: ir.Expr) -> str:
    """One expression with the types of every operation. `!` marks operations that may fault."""
    if isinstance(e, ir.Const):
        return f"{e.value!r}:{e.type}"
    if isinstance(e, ir.Local | ir.ModuleConst):
        return e.name
    if isinstance(e, ir.RangeVar):
        return f"{e.name}[{e.low}..{e.high}]"
    if isinstance(e, ir.Field):
        return f"{e.record}.{e.name}"
    if isinstance(e, ir.Element):
        indices = ", ".join(expr_text(i) + ("!" if c else "") for i, c in zip(e.indices, e.checked, strict=True))
        return f"{expr_text(e.base)}[{indices}]"
    if isinstance(e, ir.Member):
        return f"{expr_text(e.base)}.{e.name}"
    if isinstance(e, ir.Slice):
        return f"{expr_text(e.base)}[{', '.join(map(_subscript, e.subscripts, e.checked))}]"
    if isinstance(e, ir.Apply):
        return f"({e.op.id}{'!' if e.fault else ''} {' '.join(map(expr_text, e.args))})"
    if isinstance(e, ir.Elementwise):
        return f"(each {e.op.id} {' '.join(map(expr_text, e.args))})"
    if isinstance(e, ir.Adjust):
        values = " ".join(f"[{n}]{v!r}" for n, v in enumerate(e.values) if v != 0.0)
        return f"(where not zero {e.op.id} {expr_text(e.base)} {values})"
    if isinstance(e, ir.Choose):
        return f"(if {expr_text(e.condition)} {expr_text(e.then)} {expr_text(e.otherwise)})"
    if isinstance(e, ir.Let):
        return f"(let {e.name} {expr_text(e.value)} {expr_text(e.body)})"
    if isinstance(e, ir.ArrayValue):
        return f"[{', '.join(map(expr_text, e.items))}]:{e.type}"
    if isinstance(e, ir.StructValue):
        return f"{e.type}({', '.join(map(expr_text, e.items))})"
    if isinstance(e, ir.EffectCall):
        return f"(effect {e.function.name} {' '.join(map(expr_text, e.args))})"
    return f"({e.function}{'!' if e.fault else ''} {' '.join(map(expr_text, e.args))})"


def _subscript(e: ir.Expr | ir.Window, checked: bool) -> str:
    if isinstance(e, ir.Window):
        return f"{e.start}:{e.start + e.count}"
    return expr_text(e) + ("!" if checked else "")
