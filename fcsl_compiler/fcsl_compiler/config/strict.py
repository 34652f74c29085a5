# SPDX-License-Identifier: Apache-2.0
"""`--strict`: requires explicit values that are otherwise optional, and warns about requests that circle."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink
from ..model import ir
from ..model.machine import Machine
from ..model.types import BOOL, HEALTH, REQUEST, Array, Scalar, Struct, Type
from .circling_requests import warn_circling_requests


def check_strict(machine: Machine, sink: DiagnosticSink) -> None:
    _check_open_inputs(machine, sink)
    warn_circling_requests(machine, sink)


def _check_open_inputs(machine: Machine, sink: DiagnosticSink) -> None:
    """Reports E240 for every instance with an input that has no connection, no channel and no initial value."""
    fed = {(c.target.instance, c.target.field) for c in machine.connections}
    fed |= {(c.port.instance, c.port.field) for c in machine.channels if c.port.record == "inputs"}
    for index, instance in enumerate(machine.instances):
        ports = instance.algorithm.ports["inputs"]
        open_ = [p for p in ports if (index, p.name) not in fed and p.name not in instance.inputs]
        if not open_:
            continue
        values = {**{n: None for n in instance.inputs}, **{p.name: _zero(p.type) for p in open_}}
        listed = ", ".join(f'"{name}": {"…" if value is None else value}' for name, value in values.items())
        names = ", ".join(f"`{p.name}`" for p in open_)
        sink.error(
            "E240",
            f"nothing feeds {'inputs' if len(open_) > 1 else 'input'} {names} of `{instance.span.local(instance.name)}`",
            instance.span,
            why="with --strict, inputs without connection or channel must be listed, to exclude a forgotten connection",
            help=f'connect {"them" if len(open_) > 1 else "it"}, or list what the host writes: "inputs": {{{listed}}}',
            notes=[(p.span, _declared(p)) for p in open_],
        )


def _declared(port: ir.Port) -> str:
    return f"`{port.name}` ({port.type}{' ' + port.unit if port.unit else ''}) is declared here"


def _zero(type_: Type) -> str:
    """The JSON literal for a type's zero."""
    if isinstance(type_, Struct):
        return "{" + ", ".join(f'"{m.name}": {_zero(m.type)}' for m in type_.members) + "}"
    if isinstance(type_, Array):
        inner: str = _zero(type_.element)
        for extent in reversed(type_.shape):
            inner = "[" + ", ".join([inner] * extent) + "]" if extent <= 16 else "[…]"
        return inner
    return _scalar_zero(type_)


def _scalar_zero(type_: Scalar) -> str:
    if type_ is HEALTH:
        return '"nominal"'
    if type_ is REQUEST:
        return '""'
    return "false" if type_ is BOOL else "0.0" if type_.is_float else "0"
