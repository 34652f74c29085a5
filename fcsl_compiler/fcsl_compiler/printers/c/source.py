# SPDX-License-Identifier: Apache-2.0
"""The C file of a machine: includes, helpers, functions, descriptor."""

from __future__ import annotations

from collections.abc import Mapping

from ...model import code
from ...model.c_names import c_comment
from ...model.events import EVENT_HEADER
from ...model.ir import HARDWARE_HEADER
from ..spelling import Spelling
from .expressions import CExpressions, declarator, type_name
from .operations.helpers import FAULT_HELPER
from .statements import CStatements
from .writer import CWriter

#: First lines of every C file. gcc 12's dead store elimination shortens the first of two overlapping copies, and its
#: analysis of what a function modifies (modref) misses what is left of it: the caller does not restore that after a
#: fault. Without both, gcc takes up to a third less time, and steps are as fast. Despite -ffp-contract=off, gcc's
#: vectoriser can fuse two roundings into one (vfmaddsub). clang 19 takes `c < 1.0 ? c : 1.0` for c where c is `1.0 < x ?
#: 1.0 : x`, which is wrong if x is NaN; it does not where exceptions may trap.
PRAGMAS = """\
#if defined(__GNUC__) && __GNUC__ > 10 && !defined(__clang__)
#pragma GCC optimize("no-ipa-modref,no-tree-dse") /* gcc 12 misses what a shortened copy modifies */
#endif
#if defined(__GNUC__) && !defined(__clang__) && defined(__FMA__)
#pragma GCC target("no-fma,no-fma4,no-avx512f") /* gcc fuses products with sums in spite of -ffp-contract */
#endif
#if defined(__clang__)
#pragma clang fp exceptions(maytrap) /* clang 19 takes min(min(x, c), c) for min(x, c), also where x is NaN */
#endif
"""

#: Functions of a program from which gcc does not specialise functions for their callers: the time that it takes to decide is
#: quadratic in the number of calls. With 5000 instances that were 5 of 14 s.
_MANY_FUNCTIONS = 1000
NO_SPECIALISATION = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-ipa-cp") /* takes quadratic time for so many calls */
#endif
"""


def print_source(program: code.Program, prelude: str, extensions: Mapping[str, Spelling]) -> CWriter:
    """The C file up to the descriptor. `prelude`: C before its functions. `extensions`: operations beside those of the
    language."""
    w = CWriter()
    w.block(f"/* {program.name}.c: made by fcslc from {program.source}. Do not edit. */")
    w.block(PRAGMAS + (NO_SPECIALISATION if len(program.functions) >= _MANY_FUNCTIONS else ""))
    w.block(f'#include "{program.name}.h"\n\n#include <math.h>\n#include <stddef.h>\n#include <string.h>')
    w.line()
    if program.uses_hardware:
        w.line(f"#include <{HARDWARE_HEADER}>")
    if program.has_events:
        w.line(f"#include <{EVENT_HEADER}>")
    w.line("#include <fcsl/fcsl_exact_math.h>")
    w.line("#include <fcsl/fcsl_math.h>")
    for header in program.headers:
        w.line(include_of(program, header))
    w.line()
    if prelude:
        w.block(prelude)
        w.line()
    print_externs(program, w)
    expressions = CExpressions(extensions)
    for table in program.tables:
        CStatements(w, expressions).table(table)
        w.line()
    for record in program.private_records:
        print_record(w, record)
    functions = CWriter()
    statements = CStatements(functions, expressions)
    for function in program.functions:
        if not function.in_header:
            statements.function(function)
    helpers = expressions.helpers
    if any("fcsl_fault(" in text for text in helpers.values()):
        w.block(FAULT_HELPER)
        w.line()
    for name in sorted(helpers):
        w.block(helpers[name])
        w.line()
    w.paste((functions.lines, functions.origins))
    return w


def include_of(program: code.Program, header: str) -> str:
    """The line that includes the header of an extern. If it is called like the machine, the file of this name beside the
    source is the machine's own."""
    return f"#include <{header}>" if header == f"{program.name}.h" else f'#include "{header}"'


def print_record(w: CWriter, record: code.Record) -> None:
    if record.like:
        w.line(f"typedef {record.like} {record.name};")
        w.line()
        return
    with w.braces("typedef struct", f"}} {record.name};"):
        for field in record.fields:
            comment = f" /* {c_comment(field.comment)} */" if field.comment else ""
            w.line(f"{declarator(field.type, field.name)};{comment}")
    w.line()


def print_externs(program: code.Program, w: CWriter) -> None:
    """Asserts that the user's header declares each extern with the types that the algorithm uses. C would convert
    silently. Externs in Nim are declared; the Nim compiler has compared them (driver/nim.py)."""
    for e in program.externs:
        w.origin = e.span
        result = "void" if e.result is None else type_name(e.result)
        parameters = ", ".join(map(type_name, e.parameters)) or "void"
        if e.language == "nim":
            w.line(f"extern {result} {e.name}({parameters});")
            w.origin = None
            continue
        signature = f"{result}({parameters})"
        test = f"__builtin_types_compatible_p(__typeof__({e.name}), {signature})"
        w.line(f'_Static_assert({test}, "{e.name} is not what {c_comment(str(e.span))} declares: {signature}");')
        w.origin = None
    if program.externs:
        w.line()
