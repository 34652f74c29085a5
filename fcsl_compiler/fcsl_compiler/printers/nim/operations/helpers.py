# SPDX-License-Identifier: Apache-2.0
"""What Nim helpers of operations are written with."""

from __future__ import annotations

import math

from ....model.types import Scalar

NIM_TYPES = {
    "bool": "bool",
    "u8": "uint8",
    "i32": "int32",
    "i64": "int64",
    "u32": "uint32",
    "u64": "uint64",
    "f32": "float32",
    "f64": "float64",
}

#: Every faulting operation calls it. It is cold, so that the C compiler optimises the path without a fault.
FAULT_HELPER = """\
proc fcsl_fault(place: uint32, fault: ptr uint32) {.codegenDecl: "static __attribute__((cold, noinline)) $# $#$#".} =
  if fault[] == 0'u32: # later faults follow from the first one
    fault[] = place
"""

INDEX_HELPER = """\
proc fcsl_index(index, size: int64, place: uint32, fault: ptr uint32): int64 {.inline.} =
  if index < 0 or index >= size:
    fcsl_fault(place, fault)
    return 0
  index
"""

FAULT = "place: uint32, fault: ptr uint32"


def nim(t: Scalar) -> str:
    return NIM_TYPES[t.name]


def literal(value: bool | int | float, t: Scalar) -> str:
    """A Nim expression with exactly this value and type."""
    if t.name == "bool":
        return "true" if value else "false"
    if t.is_float:
        return _float(float(value), t)
    suffix = f"'{t.name}"
    if t.is_signed and value == t.low:
        return f"low({nim(t)})"
    return f"({value}{suffix})" if value < 0 else f"{value}{suffix}"


def _float(value: float, t: Scalar) -> str:
    suffix = f"'{t.name}"
    if math.isnan(value) or math.isinf(value):
        word = "NaN" if math.isnan(value) else "Inf" if value > 0 else "(-Inf)"
        return word if t.name == "f64" else f"float32({word})"
    # 17 digits are exact for f64, and so for f32.
    text = repr(value)
    return f"({text}{suffix})" if text.startswith("-") else f"{text}{suffix}"


def proc(name: str, arguments: str, result: str, *body: str) -> str:
    """Definition of a Nim helper."""
    lines = "\n".join("  " + line for line in body)
    return f"proc {name}({arguments}): {result} {{.inline.}} =\n{lines}\n"


def imported(name: str, arguments: str, result: str, c: str, header: str = "") -> str:
    """Declaration of a C function, or of anything that is written like a call."""
    place = f'header: "{header}"' if header else "nodecl"
    return f'proc {name}({arguments}): {result} {{.importc: "{c}", {place}.}}\n'
