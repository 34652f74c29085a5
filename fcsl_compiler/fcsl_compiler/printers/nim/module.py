# SPDX-License-Identifier: Apache-2.0
"""The Nim module of a machine."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from ...emit.functions import HOST_TYPE
from ...model import code
from ...model.effects import HARDWARE
from ...model.events import EVENT_HEADER, MOST_VALUES, is_event_value
from ...model.ir import HARDWARE_HEADER
from ...model.types import SCALARS, U32, U64, Scalar
from ..c.header import header_guard
from ..c.source import PRAGMAS, include_of, print_externs, print_record
from ..c.writer import CWriter
from .expressions import Module
from .statements import NimStatements, print_table
from .writer import NimWriter

_PRELUDE = """\
{.push checks: off, stackTrace: off, raises: [], warning[UnreachableElse]: off.}
{.pragma: usual, codegenDecl: "static $# $#$#".}
{.pragma: hint, codegenDecl: "static inline $# $#$#".}
{.pragma: always, codegenDecl: "static inline __attribute__((always_inline)) $# $#$#".}
{.pragma: never, codegenDecl: "static __attribute__((noinline)) $# $#$#".}
{.pragma: rare, codegenDecl: "static __attribute__((cold, noinline)) $# $#$#".}
{.pragma: flat, codegenDecl: "static __attribute__((flatten)) $# $#$#".}
{.pragma: flat_never, codegenDecl: "static __attribute__((noinline, flatten)) $# $#$#".}
"""

_HOST = """\
type
  Health* {.size: 4, pure.} = enum
    nominal, degraded, failed, stale
  Host* {.importc: "fcsl_host_t", header: "fcsl/fcsl_machine.h".} = object
    ## What a step may use of its host (fcsl_machine.h).
    ctx*: pointer
    clock_ns*: proc (ctx: pointer): uint64 {.cdecl, raises: [].}
    hw*: pointer
    substitute*: proc (ctx: pointer, instance: uint32): int32 {.cdecl, raises: [].}
    executed*: proc (ctx: pointer, instance: uint32) {.cdecl, raises: [].}
    measure*: proc (ctx: pointer, instance: int32) {.cdecl, raises: [].}
    events*: pointer
"""

#: Nim has no pointers to constants.
_QUIET = """\
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wincompatible-pointer-types"
#pragma GCC diagnostic ignored "-Wdiscarded-qualifiers"
#endif
"""
_INCLUDES = "#include <math.h>\n#include <stdbool.h>\n#include <string.h>\n#include <fcsl/fcsl_machine.h>\n"

_LOOPS = {
    "fcsl_up": """\
iterator fcsl_up(start, stop, step: int64): int64 {.inline.} =
  var i = start
  while i < stop:
    yield i
    i = i + step
""",
    "fcsl_down": """\
iterator fcsl_down(start, stop, step: int64): int64 {.inline.} =
  var i = start
  while i > stop:
    yield i
    i = i - step
""",
}


def print_module(program: code.Program, print_descriptor: Callable[[CWriter], None]) -> NimWriter:
    """`print_descriptor` writes the C of the descriptor. It is constant data with addresses, valid before anything
    runs, which Nim cannot write."""
    w, module = NimWriter(), Module(program)
    w.line(f"# {program.name}.nim: made by fcslc from {program.source}. Do not edit.")
    functions, helpers = NimWriter(), dict[str, str]()
    statements = NimStatements(functions, module, helpers)
    for function in program.functions:
        statements.function(function)
    text = functions.text()
    if "volatileStore(" in text:
        w.line("import std/volatile")
        w.line()
    w.block(_PRELUDE)
    own_types = f"#define {header_guard(program.name)} /* the types of {program.name}.h are below */\n"
    freed = "".join(f"#undef {name}\n" for name in sorted(_like_macros(module, statements.variables)))
    _emit(w, "/*INCLUDESECTION*/\n" + PRAGMAS + _INCLUDES + own_types)
    _emit(w, "/*TYPESECTION*/\n" + _QUIET + freed)
    w.line()
    w.block(_HOST)
    _enum(w, module, module.state_type, program.states)
    _enum(w, module, module.request_type, program.requests)
    for record in (*program.records, *program.private_records):
        _record(w, module, record)
    w.line()
    for table in program.tables:
        print_table(w, module, table, module.globals)
    if program.tables:
        w.line()
    foreign = _foreign(module, program)
    for line in foreign:
        w.line(line)
    if program.externs:
        # Nim defines in C the records that a proc uses. The headers of externs may use all of them.
        w.line('proc fcsl_records() {.exportc: "fcsl_records", usual.} =')
        with w.indented():
            for n, record in enumerate(program.records):
                w.line(f"var r{n}: {module.types_of[record.name]}")
    if foreign:
        w.line()
    for part in (*(loop for name, loop in _LOOPS.items() if f" {name}(" in text), *helpers.values()):
        w.block(part)
        w.line()
    w.paste((functions.lines, functions.origins))
    _face(w, module, program)
    data = CWriter()
    if program.headers:
        for record in (r for r in program.records if r.like):
            print_record(data, record)
    for header in program.headers:
        data.line(include_of(program, header))
    print_externs(program, data)
    print_descriptor(data)
    _emit(w, "/*VARSECTION*/\n" + data.text())
    w.line("{.pop.}")
    return w


def _emit(w: NimWriter, text: str) -> None:
    assert '"""' not in text
    w.origin = None
    w.line('{.emit: ["""')
    for line in text.rstrip("\n").split("\n"):
        w.lines.append(line)
        w.origins.append(None)
    w.lines.append('"""].}')
    w.origins.append(None)


def _like_macros(module: Module, variables: set[str]) -> set[str]:
    """Names of the machine that may be macros of the C library (limits.h), which nimbase.h includes."""
    fields = {field.name for fields in module.fields.values() for field in fields}
    return {name for name in fields | variables if re.fullmatch(r"[A-Z][A-Z0-9_]+", name)}


def _foreign(module: Module, program: code.Program) -> list[str]:
    """Declarations of the C functions that algorithms call: externs, and those of the board's hardware."""
    made = []
    for e in program.externs:
        made.append(_declaration(module, e.name, e.parameters, e.result, "nodecl"))
    if program.uses_hardware:
        for builtin in HARDWARE.values():
            types: list[code.Type] = [HOST_TYPE, *(t for _, t in builtin.arguments if isinstance(t, Scalar))]
            result = builtin.result
            assert result is None or isinstance(result, Scalar)
            made.append(_declaration(module, builtin.name, types, result, f'header: "{HARDWARE_HEADER}"'))
    if program.has_events:
        made += _event_functions(module)
    return made


def _event_functions(module: Module) -> list[str]:
    functions: list[tuple[str, list[code.Type], Scalar | None]] = [
        ("fcsl_event_begin", [HOST_TYPE, U32], None),
        ("fcsl_event_undo", [HOST_TYPE], None),
        ("fcsl_event", [HOST_TYPE, U32, *[U64] * MOST_VALUES], None),
    ]
    functions += [(f"fcsl_event_{t.name.lower()}", [t], U64) for t in SCALARS.values() if is_event_value(t)]
    return [_declaration(module, name, types, r, f'header: "{EVENT_HEADER}"') for name, types, r in functions]


def _declaration(
    module: Module, name: str, parameters: Sequence[code.Type], result: code.Type | None, where: str
) -> str:
    arguments = ", ".join(f"a{n}: {module.type_name(type_)}" for n, type_ in enumerate(parameters))
    returned = "" if result is None else f": {module.type_name(result)}"
    return f'proc {module.globals.of(name)}({arguments}){returned} {{.importc: "{name}", {where}.}}'


def _enum(w: NimWriter, module: Module, name: str, constants: tuple[str, ...]) -> None:
    w.line(f"  {name}* {{.size: 4, pure.}} = enum")
    w.line("    " + ", ".join(module.labels[c].split(".", 1)[1] for c in constants))


def _record(w: NimWriter, module: Module, record: code.Record) -> None:
    if record.like:
        w.line(f"  {module.types_of[record.name]}* = {module.types_of[record.like]}")
        return
    w.line(f'  {module.types_of[record.name]}* {{.exportc: "{record.name}".}} = object')
    for field in record.fields:
        name = module.members.of(field.name)
        plain = name == field.name and not re.search(r"_\d", name)
        pragma = "" if plain else f' {{.exportc: "{field.name}".}}'
        comment = f" ## {field.comment}" if field.comment else ""
        w.line(f"    {name}*{pragma}: {module.type_name(field.type)}{comment}")


def _face(w: NimWriter, module: Module, program: code.Program) -> None:
    """What a Nim program hosts the machine with."""
    machine = module.types_of[f"{program.name}_t"]
    entries = ("init", "start", "step", "force_state")
    init, start, step, force = (module.globals.of(f"fcsl_{entry}_{program.name}") for entry in entries)
    w.block(f"""\
proc initMachine*(m: var {machine}): int32 =
  ## Zeroes the machine, binds parameters, runs start of every instance. Returns 0, or 1 + the index of the instance whose
  ## start faulted.
  {init}(addr m)
  {start}(addr m)

proc step*(m: var {machine}, host: var Host) =
  ## Runs one tick.
  {step}(addr m, addr host)

proc forceState*(m: var {machine}, state: {module.state_type}) =
  ## Enters a state immediately.
  {force}(addr m, int32(ord(state)))
""")
    w.line()
