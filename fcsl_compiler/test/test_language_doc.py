# SPDX-License-Identifier: Apache-2.0
"""docs/language.md keeps in step with the op table and the library. FCSL_UPDATE_GOLDEN=1 rewrites its generated tables."""

import ast
import os
import re
from pathlib import Path

import pytest

from fcsl_compiler import ops
from fcsl_compiler.diagnostics import Severity
from fcsl_compiler.effects import HARDWARE, HARDWARE_DOC
from fcsl_compiler.functions import library
from fcsl_compiler.passes import Compilation, compile_machine
from fcsl_compiler.scope import CONSTRUCTORS
from fcsl_compiler.types import SCALARS

DOC = Path(__file__).parents[2] / "docs" / "language.md"


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def builtins() -> str:
    rows = []
    for doc in ops.BUILTINS.values():
        call, _, meaning = doc.partition(": ")
        rows.append(f"| `{call}` | {cell(meaning)} |")
    return "\n".join(["| call | meaning |", "|---|---|", *rows])


def functions() -> str:
    rows = []
    for name, (_, node) in library().items():

        def text(a: ast.expr | None) -> str:
            assert isinstance(a, ast.Constant)
            return str(a.value)

        arguments = ", ".join(f"{a.arg}: {text(a.annotation)}" for a in node.args.args)
        meaning = (ast.get_docstring(node) or "").split("\n")[0]
        rows.append(f"| `{name}({arguments})` | `{text(node.returns)}` | {cell(meaning)} |")
    return "\n".join(["| function | result | meaning |", "|---|---|---|", *rows])


def hardware() -> str:
    rows = []
    for name, function in HARDWARE.items():
        arguments = ", ".join(f"{n}: {t}" for n, t in function.arguments)
        rows.append(
            f"| `{name}({arguments})` | {f'`{function.result}`' if function.result else ''} | {HARDWARE_DOC[name]} |"
        )
    return "\n".join(["| call | result | meaning |", "|---|---|---|", *rows])


@pytest.mark.parametrize(
    ("name", "table"), [("builtins", builtins()), ("library", functions()), ("hardware", hardware())]
)
def test_generated_tables(name: str, table: str) -> None:
    text = DOC.read_text()
    pattern = re.compile(rf"(<!-- generated: {name} [^\n]*-->\n)(.*?)(<!-- end -->)", re.DOTALL)
    match = pattern.search(text)
    assert match, f"docs/language.md has no generated table `{name}`"
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        DOC.write_text(text[: match.start(2)] + table + "\n" + text[match.end(2) :])
        return
    assert match.group(2) == table + "\n", "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_every_builtin_says_what_it_does() -> None:
    for name, doc in ops.BUILTINS.items():
        assert doc.startswith(f"{name}(") and doc.endswith("."), name


def test_every_type_and_constructor_is_described() -> None:
    text = DOC.read_text()
    for name in (*SCALARS, *CONSTRUCTORS):
        assert f"`{name}" in text, name
