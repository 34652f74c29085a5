# SPDX-License-Identifier: Apache-2.0
"""`fcsl explain` for a function: arguments, result, equation, order of operations, limits of the equation."""

from __future__ import annotations

import ast
import textwrap

from ..check.library_files import library_names, overloads
from ..check.scope import CONSTRUCTORS
from ..model import ops
from ..model.effects import HARDWARE, HARDWARE_DOC
from ..model.events import EVENT, EVENT_DOC


def function_names() -> list[str]:
    """Names of all functions that an algorithm can call."""
    return [*ops.DOCS, *CONSTRUCTORS, *HARDWARE, EVENT, *library_names()]


def function_page(name: str) -> str | None:
    """The page of a function. None if the function does not exist."""
    library = "".join(f"\n{_library_page(name, node)}" for node in overloads(name))
    if name in ops.DOCS:
        doc = ops.DOCS[name]
        kinds = dict.fromkeys(str(op.args[-1]) for op in ops.all_ops() if op.name == name)
        lines = (doc.call, "", f"    {doc.meaning}", "", f"On: {', '.join(kinds)}.", f"Order: {doc.order}.")
        return "\n".join(lines) + f"\nSingular: {doc.singular}.\n{library}"
    if name in CONSTRUCTORS or name == EVENT:
        call, _, meaning = {**CONSTRUCTORS, EVENT: EVENT_DOC}[name].partition(": ")
        return f"{call}\n\n    {meaning}\n"
    if name in HARDWARE:
        arguments = ", ".join(f"{n}: {t}" for n, t in HARDWARE[name].arguments)
        return f"{name}({arguments}) -> {HARDWARE[name].result}\n\n    {HARDWARE_DOC[name]}\n"
    return library.removeprefix("\n") or None


def _library_page(name: str, node: ast.FunctionDef) -> str:
    arguments = ", ".join(f"{a.arg}: {_text(a.annotation)}" for a in node.args.args)
    text = textwrap.indent(ast.get_docstring(node) or "", "    ")
    return f"{name}({arguments}) -> {_text(node.returns)}\n\n{text}\n"


def _text(annotation: ast.expr | None) -> str:
    return str(annotation.value) if isinstance(annotation, ast.Constant) else ""
