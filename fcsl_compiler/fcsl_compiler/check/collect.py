# SPDX-License-Identifier: Apache-2.0
"""Collects the module level of an algorithm file: classes, constants, functions, imports. Bodies are checked later."""

from __future__ import annotations

import ast
from collections.abc import Collection, Mapping

from ..base.diagnostics import DiagnosticSink, misspelt, nearest
from ..base.source import SourceFile, Span
from ..model import ir, ops
from ..model.effects import HARDWARE
from ..model.events import EVENT
from ..model.types import SCALARS, Struct, TypeNames
from ..parse.python_source import EDITOR_MODULES, span_of
from .algorithm_class import METHODS, name_span, read_class
from .constants import check_constant, check_defaults
from .declarations import Declarations
from .externs import is_extern, read_extern
from .library_files import library_names
from .scope import BUILTIN_CONSTANTS, CONSTRUCTORS, LANGUAGE_NAMES, SHADOWABLE
from .unsupported_python import instead_of_function, instead_of_import

#: Names that fcsl_builtins offers in addition to the library.
IMPORTABLE = (
    "extern",
    EVENT,
    *HARDWARE,
    *ops.BUILTINS,
    *CONSTRUCTORS,
    *BUILTIN_CONSTANTS,
    *(n for n in SCALARS if n not in ops.BUILTINS),
)


def importable() -> list[str]:
    """All names of fcsl_builtins."""
    return list(dict.fromkeys((*IMPORTABLE, *library_names())))


def collect(
    source: SourceFile,
    tree: ast.Module,
    owner: str,
    structs: dict[str, Struct],
    sink: DiagnosticSink,
    modules: Mapping[str, Declarations | None] | None = None,
    used: Collection[str] = (),
) -> Declarations:
    """Collects the classes, folded constants and functions of a file. Order is free, except that a constant precedes
    its uses.

    `modules`: the imported files by module name, None for a file with a reported error. `used`: the classes that the
    machine uses.
    """
    declarations = Declarations(source, owner, TypeNames({}, structs), tree=tree)
    beginning = True  # True while only the docstring and __future__ imports have been read
    for position, node in enumerate(tree.body):
        span = span_of(source, node)
        if isinstance(node, ast.Expr) and position == 0 and isinstance(node.value, ast.Constant):
            continue
        if isinstance(node, ast.ImportFrom) and node.module == "__future__" and not beginning:
            fix = "move it to the beginning of the file"
            sink.error("E304", "`__future__` is imported before everything else", span, help=fix)
            continue
        beginning = beginning and isinstance(node, ast.ImportFrom) and node.module == "__future__"
        if isinstance(node, ast.ImportFrom | ast.Import):
            _import(declarations, node, modules or {}, sink)
        elif isinstance(node, ast.ClassDef):
            if _free(declarations, node.name, span, sink):
                declarations.classes[node.name] = read_class(source, node, declarations.names, node.name in used, sink)
            else:
                declarations.wrong.add(node.name)
        elif isinstance(node, ast.FunctionDef) and node.name in METHODS:
            fix = f"move it into the class of its algorithm: `def {node.name}(self):`"
            sink.error("E303", f"`{node.name}` at module level", name_span(source, node), help=fix)
            declarations.wrong.add(node.name)
        elif isinstance(node, ast.FunctionDef):
            if _free(declarations, node.name, span, sink):
                _function(declarations, node, sink)
            elif node.name not in declarations.defined:
                declarations.wrong.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            _constant(declarations, node, sink)
        else:
            fix = "a file contains algorithm classes, constants and functions"
            sink.error("E303", "this does not belong at module level", span, help=fix)
    return declarations


# ---- imports -------------------------------------------------------------------------------------------------------


def _import(
    declarations: Declarations,
    node: ast.ImportFrom | ast.Import,
    modules: Mapping[str, Declarations | None],
    sink: DiagnosticSink,
) -> None:
    source, why = declarations.source, "an algorithm is compiled from its file and the files in its folder"
    if isinstance(node, ast.Import):
        for alias in node.names:
            if alias.name == "fcsl_builtins" or alias.name in modules:
                fix = f"write `from {alias.name} import …`"
            else:
                fix = instead_of_import(alias.name, (), ())
            sink.error("E304", f"`{alias.name}` cannot be imported", span_of(source, alias), why=why, help=fix)
            declarations.wrong.add(alias.asname or alias.name.partition(".")[0])
        return
    name, known = node.module or "", node.level == 0
    if known and name in EDITOR_MODULES:
        allowed = EDITOR_MODULES[name]
        if allowed is not None and any(alias.name not in allowed for alias in node.names):
            fix = f"`{allowed[0]}` is all that can be imported here"
            sink.error("E304", f"this cannot be imported from `{name}`", span_of(source, node), help=fix)
            return
    elif not (known and name in modules):
        fix = instead_of_import(name, [a.name for a in node.names], importable())
        if node.level:
            fix = f"write `from {name or 'frames'} import …`: modules are searched in the folder of this file"
        shown = f"`{'.' * node.level}{name}` cannot be imported"
        sink.error("E304", shown, span_of(source, node), why=why, help=fix)
        declarations.wrong.update(alias.asname or alias.name for alias in node.names)
        return
    for alias in node.names:
        if alias.asname not in (None, alias.name):
            renamed = f"`{alias.asname}` would mean something else here than in CPython"
            at, fix = span_of(source, alias), "import it as it is"
            sink.error("E304", "an import under another name", at, why=renamed, help=fix)
            declarations.wrong.add(alias.asname or alias.name)
        elif name in modules and name not in EDITOR_MODULES:
            _name_of_module(declarations, name, modules[name], alias, sink)


def _name_of_module(
    declarations: Declarations, module: str, other: Declarations | None, alias: ast.alias, sink: DiagnosticSink
) -> None:
    """`from module import name`: imports a helper or a constant from a file in the same folder."""
    name, span = alias.name, span_of(declarations.source, alias)
    if other is None or name in other.wrong:  # the error in that file, or in that name, was reported
        declarations.wrong.add(name)
        return
    offered = [*other.functions, *(n for n in other.constants if n in other.defined)]
    offered = [n for n in offered if n not in other.imported]
    if name == "*":
        fix = f"name them: `from {module} import {', '.join(offered) or '…'}`"
        sink.error(
            "E311", f"`*` imported from `{module}`", span, why="the source of each name must be visible", help=fix
        )
        declarations.wrong.update(offered)
    elif name not in offered:
        what = "an algorithm" if name in other.classes else "an extern" if name in other.externs else ""
        fix = nearest(name, offered) or (f"it offers {', '.join(offered)}" if offered else "it offers nothing")
        why = "helpers and constants are shared" if what else ""
        message = f"`{name}` of `{module}` is {what}" if what else f"`{module}` has no helper or constant `{name}`"
        fix = "write a stub of it in this file" if what == "an extern" else fix
        sink.error("E311", message, span, why=why, help=fix)
        declarations.wrong.update((name, misspelt(name, offered)))  # the body may use the correct name
    elif _free(declarations, name, span, sink):
        if name in other.functions:
            declarations.imported[name] = other
            return
        declarations.constants[name] = other.constants[name]
        if name in other.names.sizes:
            declarations.names.sizes[name] = other.names.sizes[name]
        if name in other.names.numbers:
            declarations.names.numbers[name] = other.names.numbers[name]


def check_imported_names(declarations: Declarations, tree: ast.Module, sink: DiagnosticSink) -> None:
    """Reports names imported from fcsl_builtins that do not exist there."""
    for node in tree.body:
        if not (isinstance(node, ast.ImportFrom) and node.module == "fcsl_builtins" and node.level == 0):
            continue
        for alias in node.names:
            if alias.name == "*" or alias.name in importable():
                continue
            if alias.name in declarations.names.structs:
                fix = "it is a struct of the machine JSON: use it without an import"
            else:
                fix = instead_of_function(alias.name, importable())
                declarations.wrong.add(alias.name)
            span = span_of(declarations.source, alias)
            sink.error("E311", f"fcsl_builtins has no `{alias.name}`", span, help=fix)


# ---- names of the module -------------------------------------------------------------------------------------------


def _free(declarations: Declarations, name: str, span: Span, sink: DiagnosticSink, function: bool = True) -> bool:
    """Registers a name. Returns False after reporting that the name is already in use."""
    if name in LANGUAGE_NAMES and (function or name not in SHADOWABLE or declarations.uses_library(name)):
        sink.error("E302", f"`{name}` is a name of the language", span, help="use another name")
    elif name.startswith("__") and not name.endswith("__"):
        why = "CPython gives such a name another one within a class"
        sink.error("E302", f"`{name}` begins with two underscores", span, why=why, help="begin it with one")
    elif name in declarations.names.structs:
        declared = declarations.names.structs[name].span
        notes = [(declared, "declared here")] if declared is not None else []
        sink.error("E302", f"`{name}` is a struct of the machine", span, help="use another name", notes=notes)
    elif name in declarations.defined:
        notes = [(declarations.defined[name], "first here")]
        sink.error("E302", f"`{name}` is defined twice", span, help="use another name", notes=notes)
    else:
        declarations.defined[name] = span
        return True
    return False


def _function(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> None:
    if not is_extern(node):
        declarations.functions[node.name] = node
        check_defaults(declarations, node, sink)
        return
    extern = read_extern(declarations, node, sink)
    if extern is None:
        declarations.wrong.add(node.name)
    else:
        declarations.externs[node.name] = extern


def _constant(declarations: Declarations, node: ast.Assign | ast.AnnAssign, sink: DiagnosticSink) -> None:
    target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
    span = span_of(declarations.source, node)
    if isinstance(target, ast.Name) and isinstance(node.value, ast.Dict):
        record = misspelt(target.id, ir.RECORDS) or target.id
        fix = f"move `{record}` into the class of its algorithm" if record in ir.RECORDS else "use separate constants"
        sink.error("E303", "a dictionary at module level", span, help=fix)
        declarations.wrong.add(target.id)
        return
    if (
        not isinstance(target, ast.Name)
        or node.value is None
        or (isinstance(node, ast.Assign) and len(node.targets) > 1)
    ):
        sink.error("E303", "this is not a module constant", span, help="write `NAME = value`, one name a line")
        return
    if not _free(declarations, target.id, span, sink, function=False):
        return
    declarations.wrong.add(target.id)
    annotation = node.annotation if isinstance(node, ast.AnnAssign) else None
    check_constant(declarations, target.id, annotation, node.value, sink)
