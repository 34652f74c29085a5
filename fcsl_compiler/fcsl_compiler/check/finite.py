# SPDX-License-Identifier: Apache-2.0
"""`"nan": "fail"`: outputs and state that a method assigns are finite when it ends, or it faults."""

from __future__ import annotations

from dataclasses import replace

from ..model import ir, ops
from ..model.types import BOOL, I64, Array, Scalar, Struct, element_of

_LOCAL = "finite.ok"


def with_finite_results(f: ir.Function, algorithm: ir.Algorithm) -> ir.Function:
    """`start` or `execute` with a check of each float at its end, in the order of the declarations."""
    assigned = algorithm.assigned[f.source_name]
    ports = [(r, p) for r in ("outputs", "state") for p in algorithm.ports[r] if p.name in assigned]
    checks = tuple(s for record, port in ports for s in _checks_of(record, port))
    if not checks:
        return f
    body = _before_returns(f.body, checks)
    body = body if body and isinstance(body[-1], ir.Return) else (*body, *checks)
    local = (_LOCAL, BOOL)
    return replace(
        f, name=f"{f.name}__finite", body=body, locals=(*f.locals, local), records=ir.records(body), faults=True
    )


def not_finite(record: str, name: str) -> str:
    """Cause of the fault."""
    return f"{'output' if record == 'outputs' else record} `{name}` is NaN or infinite"


def _checks_of(record: str, port: ir.Port) -> tuple[ir.Stmt, ...]:
    return _checks(ir.Field(port.type, record, port.name, port.span), ops.requirement(not_finite(record, port.name)), 0)


def _checks(place: ir.Place, op: ops.Op, depth: int) -> tuple[ir.Stmt, ...]:
    """Of all floats of a place. The fault is at the declaration of the port."""
    type_, span = place.type, place.span
    if isinstance(type_, Struct):
        members = [ir.Member(m.type, place, m.name, span) for m in type_.members]
        return tuple(s for member in members for s in _checks(member, op, depth))
    if isinstance(type_, Array):
        variables = [
            ir.RangeVar(I64, f"finite.{depth + n}", 0, extent - 1, span) for n, extent in enumerate(type_.shape)
        ]
        element = ir.Element(element_of(type_), place, tuple(variables), (False,) * len(variables), span)
        body = _checks(element, op, depth + len(variables))
        for v in reversed(variables):
            bounds = ir.Const(I64, 0, span), ir.Const(I64, v.high + 1, span)
            body = (ir.For(v.name, *bounds, 1, body, span),) if body else ()
        return body
    test = ops.find("isfinite", (type_,)) if isinstance(type_, Scalar) else None
    if test is None:
        return ()
    finite = ir.Apply(BOOL, test, (place,), False, span)
    return (ir.Assign(ir.Local(BOOL, _LOCAL, span), ir.Apply(BOOL, op, (finite,), True, span), span),)


def _before_returns(body: tuple[ir.Stmt, ...], checks: tuple[ir.Stmt, ...]) -> tuple[ir.Stmt, ...]:
    out: list[ir.Stmt] = []
    for s in body:
        if isinstance(s, ir.If):
            s = replace(s, then=_before_returns(s.then, checks), otherwise=_before_returns(s.otherwise, checks))
        elif isinstance(s, ir.For):
            s = replace(s, body=_before_returns(s.body, checks))
        elif isinstance(s, ir.Return):
            out += checks
        out.append(s)
    return tuple(out)
