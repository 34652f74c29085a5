# SPDX-License-Identifier: Apache-2.0
"""Python and NumPy idioms that the language lacks, and their replacements."""

from __future__ import annotations

from collections.abc import Collection

from ..base.diagnostics import nearest

#: Python builtins.
BUILTINS: dict[str, str] = {
    "bool": "write a comparison",
    "divmod": "write `a // b` and `a % b`",
    "enumerate": "write `for i in range(n):` and index the array",
    "float": "write `f64(x)`",
    "getattr": "name the field",
    "input": 'declare an input: `inputs = {"rate": "f64 rad/s"}`',
    "int": "write `i64(x)`: it truncates, and faults when out of range",
    "isinstance": "every type is known at compile time",
    "list": "an array is written `[a, b]` or `zeros(n)`",
    "map": "write a bounded `for` loop",
    "open": "an algorithm has no files; values come from parameters, and recordings hold every output",
    "print": "assign it to an output: recordings show every output of every tick",
    "range": "`range` is allowed only in a `for` line",
    "reversed": "write `for i in range(n - 1, -1, -1):`",
    "sorted": "write `sort(x)`",
    "str": "algorithms compute with numbers; report with health, requests and outputs",
    "super": "an algorithm inherits nothing",
    "tuple": "an array is written `[a, b]`",
    "zip": "write `for i in range(n):` and index both arrays",
}

#: Functions of math, numpy and numpy.linalg, and array methods, that have another name here.
_FUNCTIONS: dict[str, str] = {
    "T": "write `transpose(a)`",
    "absolute": "write `abs(x)`",
    "amax": "write `max(x)`",
    "amin": "write `min(x)`",
    "append": "the size of an array is fixed: declare it whole, and count what is in use",
    "arange": "write `for i in range(n):`",
    "arccos": "write `acos(x)`",
    "arcsin": "write `asin(x)`",
    "arctan": "write `atan(x)`",
    "arctan2": "write `atan2(y, x)`",
    "array": "an array is written `[a, b]`",
    "asarray": "an array is written `[a, b]`",
    "clip": "write `clamp(x, low, high)`",
    "concatenate": "write `zeros(n)` and assign its slices",
    "copy": "every assignment copies",
    "cross": "write `cross3(a, b)`",
    "deg2rad": "write `x * (pi / 180.0)`",
    "degrees": "write `x * (180.0 / pi)`",
    "e": "write `exp(1.0)`",
    "empty": "write `zeros(n)`",
    "fabs": "write `abs(x)`",
    "float32": "write `f32(x)`",
    "float64": "write `f64(x)`",
    "full": "write `zeros(n)` and assign the elements",
    "identity": "write `eye(n)`",
    "int32": "write `i32(x)`",
    "int64": "write `i64(x)`",
    "isclose": "write `abs(a - b) < tolerance`",
    "maximum": "write `max(a, b)`",
    "minimum": "write `min(a, b)`",
    "multiply": "write `a * b`",
    "ones": "write `zeros(n)` and assign the elements",
    "power": "write `pow(x, y)`, or `x ** 2`",
    "rad2deg": "write `x * (180.0 / pi)`",
    "radians": "write `x * (pi / 180.0)`",
    "shape": "sizes are known at compile time; write the number or a module constant",
    "size": "sizes are known at compile time; write the number or a module constant",
    "tau": "write `2.0 * pi`",
    "uint32": "write `u32(x)`",
    "uint64": "write `u64(x)`",
}

#: Modules and the replacement for what they offer.
MODULES: dict[str, str] = {
    "math": "its functions are builtins: write `sin(x)`, `sqrt(x)`, `pi`",
    "cmath": "there are no complex numbers; keep real and imaginary part",
    "numpy": "arrays are part of the language: write `[0.0, 0.0]`, `zeros(3)`, `a + b`, `dot(a, b)`, `matvec(m, x)`",
    "scipy": "the library has `solve`, `inv`, `cholesky`, the `kf_` and `quat_` functions",
    "random": "a random number is an input; let the simulation make it, from its seed",
    "time": "connect an input from `machine.dt`, `machine.time_ns` or `machine.tick`",
    "datetime": "connect an input from `machine.time_ns`",
    "typing": 'types are built in: `f64`, `i32`, `"f64[3]"`',
    "dataclasses": "an algorithm is a plain class; structs are declared in the machine JSON",
    "logging": "assign it to an output: recordings show every output of every tick",
    "enum": "name integers with module constants",
}


def instead_of(name: str, known: Collection[str]) -> str:
    """Replacement for a Python function, method or constant of this name; "" if none corresponds.

    known: the functions and constants of the language.
    """
    if name in _FUNCTIONS:
        return _FUNCTIONS[name]
    if name in ("pi", "inf", "nan"):
        return f"write `{name}`"
    return f"write `{name}(…)`" if name in known else BUILTINS.get(name, "")


def instead_of_function(name: str, known: Collection[str]) -> str:
    """Replacement for a function that the language lacks."""
    family = [k for k in known if k.split("_")[0] == name.split("_")[0] and "_" in k]
    return (
        BUILTINS.get(name)
        or _FUNCTIONS.get(name)
        or nearest(name, list(known))
        or (f"there are {', '.join(family)}" if family else "")
        or "docs/reference/library.md lists what there is; anything else is a helper in this file"
    )


def instead_of_import(module: str, names: Collection[str], known: Collection[str]) -> str:
    """Help text for an import that the language lacks: replacements for the module or for the imported names."""
    same = sorted(n for n in names if n in known)
    if same:
        return f"write `from fcsl_builtins import {', '.join(same)}`"
    used = [text for text in (instead_of(n, known) for n in sorted(names)) if text]
    hint = used[0] if used else MODULES.get(module.split(".")[0], "")
    return hint or f"there is no {module.replace('.', '/')}.py in the folder of this file"
