# SPDX-License-Identifier: Apache-2.0
"""docs/reference/library.md is generated from the op table and the library's docstrings. FCSL_UPDATE_GOLDEN=1 rewrites it."""

import ast
import os
import re
import textwrap
from pathlib import Path

from fcsl_compiler.check.functions import library
from fcsl_compiler.check.library_files import library_names, overloads
from fcsl_compiler.model import ops
from fcsl_compiler.model.types import NUMBERS

PAGE = Path(__file__).parents[2] / "docs/reference/library.md"

HEAD = """<!-- Made by fcsl_compiler/test/test_library_doc.py from the compiler's own tables. Do not edit. -->
# Functions of the language

Each row has the equation, the order of the operations (what is rounded, and when) and what happens outside the
domain. Compiled code and [CPython](language.md#pytwin-the-same-in-cpython) give the same bits on every computer.
No function allocates, and every loop has a bound.

"rounded once" is correct rounding: the exact result, rounded to nearest even. The elementary functions are CORE-MATH's.
`fcsl_compiler/test/test_rounding.py` compares them with arbitrary precision at 100 000 hard points each, without a
difference. Where a row says nothing else, a NaN among the operands gives NaN.
"""

LIBRARY_HEAD = """
# Numeric library

These functions are written in the language itself (`fcsl_compiler/fcsl_compiler/library/`); the compiler checks and
compiles them for each combination of types and sizes in use. `F` is `f64` or `f32`, `T` any number, the same in all
arguments. Size variables (`n`, `m`, `k`) stand for constants. Sums run from left to right and start from the first
product. A NaN among the elements comes out wherever it enters an operation. `test_linear_systems.py` compares their
accuracy with exact arithmetic, within the bounds of error analysis, and with NumPy, SciPy and filterpy;
`test_arrays.py` compares those of vectors and tables.
"""
HEADINGS = {
    "linear_algebra": "Vectors and matrices",
    "quaternion": "Quaternions: scalar first, body → world",
    "kalman": "Kalman filter",
    "arrays": "Sums and order of vectors",
    "tables": "Tables",
}


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def operands(name: str) -> str:
    """Text of the types that the function takes."""
    found = {str(op.args[-1]) for op in ops.all_ops() if op.name == name} - {"bool"}
    kinds = {
        "every number": {str(t) for t in NUMBERS},
        "floats": {"f32", "f64"},
        "integers": {str(t) for t in NUMBERS if t.is_integer},
    }
    kinds["signed, floats"] = {"i32", "i64", "f32", "f64"}
    return next(word for word, types in kinds.items() if types == found)


def builtins() -> str:
    text, group = "", ""
    for name, doc in ops.DOCS.items():
        if doc.group != group:
            group = doc.group
            text += f"\n## {group}\n| call | on | meaning | order, rounding | special cases |\n|---|---|---|---|---|\n"
        cells = [f"`{doc.call}`", operands(name), doc.meaning, doc.order, doc.singular]
        text += f"| {' | '.join(map(cell, cells))} |\n"
    return text


def signature(name: str, node: ast.FunctionDef) -> str:
    def written(annotation: ast.expr | None) -> str:
        assert isinstance(annotation, ast.Constant)
        return str(annotation.value)

    arguments = ", ".join(f"{a.arg}: {written(a.annotation)}" for a in node.args.args)
    return f"{name}({arguments}) -> {written(node.returns)}"


def sections(node: ast.FunctionDef) -> dict[str, str]:
    """Parts of a docstring by keyword. The first part is the meaning."""
    summary, _, rest = (ast.get_docstring(node) or "").partition("\n\n")
    parts = re.split(r"^(Source|Order|Singular): ", rest, flags=re.MULTILINE)
    assert parts[0] == "", f"{node.name}: {parts[0]}"
    found = {"Meaning": summary} | dict(zip(parts[1::2], parts[2::2], strict=True))
    return {word: " ".join(text.split()) for word, text in found.items()}


def file_of(name: str) -> str:
    return Path(library()[overloads(name)[0].name][0].source.name).stem


def index() -> str:
    """A short table of all functions for docs/reference/language.md."""
    rows: dict[str, list[str]] = {}
    for doc in ops.DOCS.values():
        rows.setdefault(doc.group, []).append(f"`{doc.call}`")
    for name in library_names():
        for node in overloads(name):
            call = f"{name}({', '.join(a.arg for a in node.args.args)})"
            rows.setdefault(HEADINGS[file_of(name)], []).append(f"`{call}`")
    return "\n".join(["| group | functions |", "|---|---|", *(f"| {g} | {' '.join(c)} |" for g, c in rows.items())])


def filled(text: str, indent: str = "") -> str:
    return textwrap.fill(text, 120 - len(indent), subsequent_indent=indent, break_on_hyphens=False)


def functions() -> str:
    text, file = LIBRARY_HEAD, ""
    for name in library_names():
        stem = file_of(name)
        if stem != file:
            file = stem
            text += f"\n## {HEADINGS[stem]}\n"
        for node in overloads(name):
            parts = sections(node)
            text += f"\n{filled(f'**`{signature(name, node)}`**')}  \n{filled(parts['Meaning'])}\n"
            items = [f"{word}: {parts[word]}" for word in ("Order", "Singular", "Source") if word in parts]
            text += "".join(f"- {filled(item, indent='  ')}\n" for item in items)
    return text


def test_the_page_is_the_tables() -> None:
    page = HEAD + builtins() + functions()
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        PAGE.write_text(page)
    assert PAGE.read_text() == page, "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_every_function_is_documented_completely() -> None:
    for name, doc in ops.DOCS.items():
        assert doc.call.startswith(f"{name}(") and all((doc.meaning, doc.order, doc.singular)), name
        assert not any(text.endswith(".") for text in (doc.meaning, doc.order, doc.singular)), name
    for name in library_names():
        for node in overloads(name):
            parts = sections(node)
            assert {"Meaning", "Order", "Singular"} <= set(parts), node.name
            assert all(text.endswith((".", "is.")) for text in parts.values()), node.name
