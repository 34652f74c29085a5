# SPDX-License-Identifier: Apache-2.0
"""Requests of a part: gives those of its algorithms the names that the whole machine has for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.program import Program
from ..model.types import REQUEST, element_of
from ..parse.json_reader import ConfigReader


def check_listed(algorithm: ir.Algorithm, parts: Iterable[Span], reader: ConfigReader) -> None:
    """Reports requests that a part does not list. `parts`: where the parts that have the algorithm name it."""
    for at in parts:
        for name, span in [*algorithm.requests, *_defaults(algorithm)]:
            if name not in reader.scopes[at.source].requests:
                fix = f'add it to the `requests` of `{at.source.name}`: "{name}"'
                notes = [(at, "an algorithm of this part")]
                why = "a part lists all that it makes"
                reader.sink.error("E256", f"request `{name}` is not listed", span, why=why, help=fix, notes=notes)


def _defaults(algorithm: ir.Algorithm) -> list[tuple[str, Span]]:
    """Requests that are defaults of parameters."""
    return [
        (str(word), port.span)
        for port in algorithm.ports["parameters"]
        if port.default is not None and element_of(port.type) is REQUEST
        for word in port.default
        if word
    ]


def bind_requests(
    algorithm: ir.Algorithm, names: Mapping[str, str], program: Program, sink: DiagnosticSink
) -> ir.Algorithm:
    """An algorithm whose requests are called as `names` says. Reports one in a helper, which other algorithms may call."""
    if all(names.get(name, name) == name for name, _ in [*algorithm.requests, *_defaults(algorithm)]):
        return algorithm
    entries = [entry for entry in (algorithm.execute, algorithm.start) if entry is not None]
    for helper in (program.helpers[name] for entry in entries for name in entry.calls if name in program.helpers):
        for name, span in helper.requests:
            fix = "name it in `execute` or `start`, such as by what the helper returns"
            sink.error("E256", f"request `{name}` of a part in a helper", span, help=fix)
    ports = tuple(_default(port, names) for port in algorithm.ports["parameters"])
    return replace(
        algorithm,
        ports={**algorithm.ports, "parameters": ports},
        execute=_function(algorithm.execute, names),
        start=_function(algorithm.start, names) if algorithm.start is not None else None,
        requests=tuple((names.get(name, name), span) for name, span in algorithm.requests),
    )


def _default(port: ir.Port, names: Mapping[str, str]) -> ir.Port:
    if port.default is None or element_of(port.type) is not REQUEST:
        return port
    return replace(port, default=tuple(names.get(str(word), word) for word in port.default))


def _function(function: ir.Function, names: Mapping[str, str]) -> ir.Function:
    requests = tuple((names.get(name, name), span) for name, span in function.requests)
    return replace(function, body=_rewritten(function.body, names), requests=requests)


def _rewritten(node: Any, names: Mapping[str, str]) -> Any:
    """IR (a tree of frozen dataclasses and tuples) with other requests."""
    if isinstance(node, ir.Const):
        return replace(node, value=names.get(str(node.value), node.value)) if node.type is REQUEST else node
    if isinstance(node, tuple):
        return tuple(_rewritten(item, names) for item in node)
    if not is_dataclass(node) or isinstance(node, type) or type(node).__module__ != ir.__name__:
        return node
    return replace(node, **{f.name: _rewritten(getattr(node, f.name), names) for f in fields(node)})
