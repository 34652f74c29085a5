# SPDX-License-Identifier: Apache-2.0
"""The files of a machine as modules: what each declares and can call. Imported files are loaded first."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import PurePosixPath

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.program import Program
from ..parse.machine_files import ParsedFile
from .algorithm_class import AlgorithmClass, read_class
from .collect import check_imported_names, collect
from .declarations import Declarations
from .functions import FunctionTable
from .scope import StoredConstant
from .unused import warn_unused_helpers, warn_unused_names


class Modules:
    """Collects each file and checks its helpers, once per file. `table` returns the functions that a file's classes can
    call."""

    def __init__(self, program: Program, used: dict[str, set[str]], sink: DiagnosticSink):
        """`used`: the classes that the machine uses, by name of their file."""
        self.program, self.used, self.sink = program, used, sink
        self._found: dict[str, Declarations | None] = {}  # by source name
        self._tables: dict[str, FunctionTable] = {}  # by owner
        self._underway: list[str] = []

    def load(self, file: ParsedFile) -> Declarations | None:
        """The declarations of a file. None if it cannot be read, is not valid Python, or imports itself; these errors
        were reported."""
        name = file.source.name
        if name in self._found or file.tree is None:
            return self._found.get(name)
        if name in self._underway:
            chain = " → ".join([*self._underway[self._underway.index(name) :], name])
            fix = "move the shared names into a third file"
            self.sink.error("E304", f"circular imports: {chain}", file.source.whole(), help=fix)
            return None
        self._underway.append(name)
        imports = {module: self.load(other) if other else None for module, other in file.imports.items()}
        self._underway.pop()
        owner, before = self._owner(file), self.sink.errors
        declarations = collect(
            file.source, file.tree, owner, self.program.structs, self.sink, imports, self.used.get(name, ())
        )
        check_imported_names(declarations, file.tree, self.sink)
        declarations.declared = self.sink.errors == before
        table = self._tables[owner] = FunctionTable(declarations, self.program, self.sink, self._tables)
        table.check_helpers()
        declarations.sound = self.sink.errors == before and all(d is not None and d.sound for d in imports.values())
        for constant, found in declarations.constants.items():
            if isinstance(found, StoredConstant) and found.owner == owner:
                self.program.constants[owner, constant] = (found.type, found.values)
        self._found[name] = declarations
        return declarations

    def table(self, declarations: Declarations) -> FunctionTable:
        return self._tables[declarations.owner]

    def read_sized(self, declarations: Declarations, node: ast.ClassDef, sizes: Mapping[str, int]) -> AlgorithmClass:
        """A class of a file with these sizes, which then counts as used."""
        names = replace(declarations.names, sizes={**declarations.names.sizes, **sizes})
        found = read_class(declarations.source, node, names, True, self.sink)
        declarations.classes[node.name] = found
        self.used.setdefault(declarations.source.name, set()).add(node.name)
        return found

    def warn_unused(self, filled: Collection[Span]) -> None:
        """W301 in files whose algorithms are used (helpers in other files may serve other machines), and W303 to W305.

        `filled`: declarations of the outputs that channels write.
        """
        found = [d for d in self._found.values() if d is not None]
        imported = {(other.owner, name) for d in found for name, other in d.imported.items()}
        for declarations in found:
            used = self.used.get(declarations.source.name, ())
            if used:
                names = {name for owner, name in imported if owner == declarations.owner}
                warn_unused_helpers(declarations, names, self.sink)
            warn_unused_names(declarations, used, filled, self.sink)

    def _owner(self, file: ParsedFile) -> str:
        """`mod_<stem>`, with a number appended if another file has the same stem."""
        stem = re.sub(r"_+", "_", re.sub(r"\W", "_", PurePosixPath(file.source.name).stem, flags=re.ASCII)).strip("_")
        owner, number = f"mod_{stem}", 1
        while owner in self._tables:
            number += 1
            owner = f"mod_{stem}_{number}"
        return owner
