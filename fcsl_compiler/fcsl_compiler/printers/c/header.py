# SPDX-License-Identifier: Apache-2.0
"""The header of a machine: enums of states and requests, a record per instance with its init and execute, and the
machine struct. Users may include it."""

from __future__ import annotations

from ...model import code
from ...model.c_names import c_comment
from .expressions import CExpressions
from .source import print_record
from .statements import CStatements, prototype
from .writer import CWriter


def header_guard(machine: str) -> str:
    """The macro of the header of a machine, which no header of a user has."""
    return f"FCSL_MACHINE_{machine.upper()}_H"


def print_header(program: code.Program) -> str:
    w, name = CWriter(), program.name
    guard = header_guard(name)
    w.block(f"/* {name}.h: made by fcslc from {c_comment(program.source)}. Do not edit. */")
    w.block(f"#ifndef {guard}\n#define {guard}\n\n#include <stdbool.h>\n#include <stdint.h>\n#include <string.h>")
    w.block("\n#include <fcsl/fcsl_machine.h>\n")
    w.block('#ifdef __cplusplus\nextern "C" {\n#endif\n')
    w.line()
    for constants in (program.states, program.requests):
        with w.braces("enum", "};"):
            for index, constant in enumerate(constants):
                w.line(f"{constant} = {index},")
        w.line()
    for record in program.records:
        print_record(w, record)
    statements = CStatements(w, CExpressions({}))
    for function in program.functions:
        if function.in_header:
            statements.function(function)
        elif function.exported:
            w.line(f"/* {function.comment} */")
            w.line(f"{prototype(function)};")
            w.line()
    w.line(f"extern const fcsl_machine_t {name}_machine;")
    w.block("\n#ifdef __cplusplus\n}\n#endif\n")
    w.line(f"\n#endif /* {guard} */".strip("\n"))
    return w.text()
