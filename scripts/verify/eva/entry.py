# SPDX-License-Identifier: Apache-2.0
"""The program EVA analyses: a machine under a host that writes anything a host may write, for ever."""

from __future__ import annotations

import math

from fcsl_compiler.emit.field_table import FieldRow, field_table
from fcsl_compiler.emit.names import channel_member, sensors
from fcsl_compiler.model.c_names import c_literal
from fcsl_compiler.model.ir import Extern
from fcsl_compiler.model.machine import Machine
from fcsl_compiler.model.types import HEALTH, REQUEST, SCALARS, Scalar

_SCALAR_OF = {scalar.abi: scalar for scalar in SCALARS.values()}
_HEALTH_WORDS = 4

_PROGRAM = """\
/* Made by scripts/verify/eva/entry.py for the machine {name}. */
#include <math.h>

#include "world.h"
#include "{name}.h"

/* Bits of no value at first, as memory that a host has just taken. */
static {name}_t *machine;

/* Whatever a host may write between ticks. */
static void host_writes(void)
{{
{writes}
}}

/* A replay puts in place what the execute of an impure instance would leave. */
static int32_t substitute(void *ctx, uint32_t instance)
{{
    (void)ctx;
    (void)instance;
    if (eva_any_bool()) {{
        return 0;
    }}
{substituted}
    return 1;
}}

{externs}int main(void)
{{
    struct fcsl_hw hw = {{0}};
    fcsl_host_t host = {{0}};
    {name}_t memory;
    machine = &memory;
    {name}_machine.init(machine);
    const int32_t failed = {name}_machine.start(machine);
    if (failed != 0) {{
        return failed;
    }}
    for (;;) {{
        eva_any_host(&host, &hw, substitute);
        host_writes();
        if (eva_any_bool()) {{
            {name}_machine.force_state(machine, eva_any_below({states}u));
        }}
        {name}_machine.step(machine, &host);
    }}
}}
"""


def entry(machine: Machine) -> str:
    """C with `main`: init, then endlessly any host writes, now and then a forced state, and a step."""
    rows = field_table(machine)
    writable = [row for row in rows if "FCSL_FIELD_WRITABLE" in row.flags]
    writes = [line for row in writable for line in _write(machine, row)]
    for channel in sensors(machine):
        member = f"machine->{channel_member(channel)}"
        writes += [f"{member}.{name} = eva_any_bool();" for name in ("attached", "fresh")]
        writes += [f"{member}.sample_age = eva_any_u32;", f"{member}.stamp_ns = eva_any_i64;"]
    for instance in machine.instances:
        writes.append(f"machine->i_{instance.identifier}.counters.inject_fault = (uint8_t)eva_any_below(4u);")
        if instance.max_wcet_us:
            writes.append(f"machine->i_{instance.identifier}.counters.inject_overrun = eva_any_bool();")
    impure = [row for row in rows if "FCSL_FIELD_IMPURE" in row.flags]
    return _PROGRAM.format(
        name=machine.name,
        states=len(machine.states),
        writes="\n".join(f"    {line}" for line in writes),
        externs="".join(_extern(machine, e) for e in machine.externs) if any_externs(machine) else "",
        substituted="\n".join(f"    {line}" for row in impure for line in _write(machine, row)),
    )


def any_externs(machine: Machine) -> bool:
    """Whether `entry` defines the externs, as functions that return any value: all take and return scalars alone."""
    types = [type_ for e in machine.externs for type_ in (*(k for _, k in e.arguments), e.result)]
    return all(type_ is None or isinstance(type_, Scalar) for type_ in types)


def _extern(machine: Machine, extern: Extern) -> str:
    arguments = [f"{type_.c} a{at}" for at, (_, type_) in enumerate(extern.arguments) if isinstance(type_, Scalar)]
    result = extern.result if isinstance(extern.result, Scalar) else None
    body = [f"(void)a{at};" for at in range(len(arguments))] + ([f"return {_any(machine, result)};"] if result else [])
    head = f"{result.c if result else 'void'} {extern.name}({', '.join(arguments) or 'void'})"
    return "\n".join([head, "{", *(f"    {line}" for line in body), "}", "", ""])


def _write(machine: Machine, row: FieldRow) -> list[str]:
    """Any value into every scalar of a field; a bounded one only takes what lies in its bounds."""
    scalar = _SCALAR_OF[row.abi_type]
    value, test = _any(machine, scalar), _bounds(row, scalar)
    if not row.shape:
        target = f"machine->{row.member}"
        return [f"{target} = {value};"] if not test else _guarded(scalar, value, test, target)
    loop = f"for (int32_t at = 0; at < {row.count}; ++at) {{"
    target = f"machine->{row.member}[at]"
    body = [f"{target} = {value};"] if not test else _guarded(scalar, value, test, target)
    return [loop, *(f"    {line}" for line in body), "}"]


def _guarded(scalar: Scalar, value: str, test: str, target: str) -> list[str]:
    return [
        "{",
        f"    const {scalar.c} value = {value};",
        f"    if ({test}) {{",
        f"        {target} = value;",
        "    }",
        "}",
    ]


def _any(machine: Machine, scalar: Scalar) -> str:
    if scalar in (HEALTH, REQUEST):
        return f"eva_any_below({_HEALTH_WORDS if scalar == HEALTH else len(machine.requests) + 1}u)"
    return "eva_any_bool()" if scalar.name == "bool" else f"eva_any_{scalar}"


def _bounds(row: FieldRow, scalar: Scalar) -> str:
    """What holds of a value that a host may set; "" where anything may be."""
    low, high = row.range.low, row.range.high
    tests = [
        f"value {sign} {c_literal(bound, scalar).partition(' ')[0]}"
        for sign, bound in ((">=", low), ("<=", high))
        if math.isfinite(bound)
    ]
    return " && ".join(tests)
