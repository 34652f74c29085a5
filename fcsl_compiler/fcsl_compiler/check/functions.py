# SPDX-License-Identifier: Apache-2.0
"""Helpers and library functions, looked up by name. All algorithms of a machine share them.

Annotations of arguments may contain size variables (`"f64[n]"`). Such a function is checked and compiled once for each
combination of sizes that a machine uses. The numeric library is written in the language itself (library/*.py).
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Mapping
from functools import cache

from ..base.diagnostics import DiagnosticSink, Note
from ..base.source import SourceFile, Span
from ..model import ir, ops
from ..model.program import Program
from ..model.types import BOOL, ELEMENTS, F64, SCALARS, Scalar, Struct, Type, TypeNames, count_of, element_of, shape_of
from ..parse.python_source import span_of
from .annotations import SIZE, annotation_text, annotation_type, result_type, sizes_in
from .breakpoints import BREAKPOINTS
from .call_order import CallGraph, call_graph, call_order
from .collect import collect
from .declarations import Declarations
from .library_files import library_files, library_names, of_elements, overloads
from .scope import LANGUAGE_NAMES, SHADOWABLE, Arguments, Scope, Signature
from .statements import BodyChecker

LIBRARY_PREFIX = "fcsl"
#: Maximum length of a chain of helper calls.
MAX_CALLS = 64


@cache
def library() -> dict[str, tuple[Declarations, ast.FunctionDef]]:
    """All library functions by name, each with the declarations of its file. `name__4` is the overload of `name` with
    four arguments."""
    found: dict[str, tuple[Declarations, ast.FunctionDef]] = {}
    for source, tree in library_files():
        sink = DiagnosticSink()
        declarations = collect(source, tree, LIBRARY_PREFIX, {}, sink)
        sink.raise_if_failed()
        found.update({name: (declarations, node) for name, node in declarations.functions.items()})
    return found


class FunctionTable:
    """The functions that one file can call. `tables`: tables of the imported files, by owner."""

    def __init__(
        self,
        declarations: Declarations,
        program: Program,
        sink: DiagnosticSink,
        tables: Mapping[str, FunctionTable] | None = None,
    ):
        self.declarations, self.program, self.sink = declarations, program, sink
        #: Helpers of this file. Empty for a library file: library functions are generic even for one another.
        self.own = declarations.functions if declarations.owner != LIBRARY_PREFIX else {}
        self.externs = declarations.externs
        self._tables = tables or {}
        self._failed: set[str] = set()
        #: For each helper, the length of the longest chain of calls that starts with it.
        self.depths: dict[str, int] = {}

    def reporting_to(self, sink: DiagnosticSink) -> FunctionTable:
        """The same table, which reports to this sink."""
        if sink is self.sink:
            return self
        table = copy.copy(self)
        table.sink = sink
        return table

    def is_function(self, name: str) -> bool:
        is_own = name in self.own or name in self.declarations.imported
        return is_own or (name in library_names() and name not in ops.BUILTINS)

    def names(self) -> list[str]:
        """All names for which is_function is true, and the externs."""
        return [*self.own, *self.declarations.imported, *self.externs, *library_names()]

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        if name in self.own:
            return self._helper(name, arguments, span)
        if name in self.declarations.imported:
            return self._table(name).resolve(name, arguments, span)
        return self._library(name, arguments, span)

    def _table(self, imported: str) -> FunctionTable:
        return self._tables[self.declarations.imported[imported].owner].reporting_to(self.sink)

    def declared(self, name: str, count: int) -> tuple[list[Type | str | None], Type | str | None]:
        """Declared types of the first `count` arguments and of the result. For a library function they are scalar types
        without array sizes, or names in ELEMENTS."""
        if name in self.declarations.imported:
            return self._table(name).declared(name, count)
        type_of: Callable[[ast.expr | None], Type | str | None] = self._annotated
        if name in self.own:
            node = self.own[name]
        else:
            found = [n for n in overloads(name) if len(n.args.args) == count]
            node, type_of = found[0] if found else overloads(name)[0], _element
        arguments = [type_of(a.annotation) for a in node.args.args]
        return (arguments + [None] * count)[:count], type_of(node.returns)

    def _annotated(self, annotation: ast.expr | None) -> Type | None:
        """The type of an annotation, with size variables as 1; what is wrong with it is said where the function is
        checked."""
        if annotation is None:
            return None
        names = self.declarations.names
        sizes = {size: 1 for size in SIZE.findall(ast.unparse(annotation)) if size.isidentifier()}
        return result_type(
            self.declarations.source, annotation, TypeNames({**sizes, **names.sizes}, names.structs), DiagnosticSink()
        )

    def unique(self, name: str) -> str:
        """Name of a helper within the whole machine. It is unambiguous because no owner contains two consecutive
        underscores."""
        return f"{self.declarations.owner}__{name}"

    def check_helpers(self) -> None:
        """Checks all helpers, callees first. A helper that no algorithm calls does not become part of the program."""
        graph = call_graph(self.own)
        order, cycles = call_order(graph, self.own)
        for chain, call in cycles:
            self._failed.update(chain)
            at, fix = span_of(self.declarations.source, call), "write a bounded `for` loop"
            message, why = f"recursion: {' → '.join(chain)}", "the stack must have a bound"
            self.sink.error("E430", message, at, why=why, help=fix)
        for name in order:
            if name in self._failed or not self._shallow(name, graph) or self._size_variables(self.own[name]):
                continue
            function = check_function(self.declarations, self.own[name], self.unique(name), {}, self, self.sink)
            if function is None:
                self._failed.add(name)
            else:
                self.program.helpers[function.name] = function

    def _shallow(self, name: str, graph: CallGraph) -> bool:
        """Computes the depth of a helper's call chain. Returns False after reporting a chain that is too long."""
        callees = [
            n.func.id for n in ast.walk(self.own[name]) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
        ]
        below = [self.depths.get(c, 0) for c in graph[name]]
        below += [self._table(c).depths.get(c, 0) for c in callees if c in self.declarations.imported]
        self.depths[name] = 1 + max(below, default=0)
        if self.depths[name] <= MAX_CALLS:
            return True
        self._failed.add(name)
        self.depths[name] = -(1 << 30)  # avoids further reports about its callers
        at = span_of(self.declarations.source, self.own[name])
        why, fix = "the stack must have a bound", "let helpers call fewer others"
        message = f"`{name}` starts a chain of more than {MAX_CALLS} helper calls"
        self.sink.error("E430", message, at, why=why, help=fix)
        return False

    # ---- helpers of this file --------------------------------------------------------------------------------------

    def arguments(self, name: str) -> Arguments | None:
        if name in self.declarations.imported:
            return self._table(name).arguments(name)
        if name not in self.own:
            return None
        node = self.own[name]
        names = tuple(a.arg for a in node.args.args)
        defaults = {a: v for (function, a), v in self.declarations.defaults.items() if function == name}
        return Arguments(names, defaults, _signature(name, node), span_of(self.declarations.source, node))

    def _size_variables(self, node: ast.FunctionDef) -> list[str]:
        """The lower-case names in the sizes of a helper's arguments that are no constants: a call gives them values."""
        texts = [annotation_text(a.annotation) or "" for a in node.args.args if a.annotation is not None]
        return sizes_in(texts, self.declarations.defined)

    def _helper(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        node, sizes = self.own[name], dict[str, int]()
        if name in self._failed:
            return None
        variables = self._size_variables(node)
        if variables:
            binding = _Binding(self.declarations.names)
            for argument, given in zip(node.args.args, arguments, strict=True):
                pattern = annotation_text(argument.annotation) if argument.annotation is not None else None
                is_open = pattern is not None and not set(SIZE.findall(pattern)).isdisjoint(variables)
                problem = binding.unify(argument.arg, pattern, given.type) if pattern and is_open else ""
                if problem:
                    notes = [(span_of(self.declarations.source, node), "defined here")]
                    fix = _signature(name, node)
                    self.sink.error("E418", f"`{name}`: {problem}", given.span, help=fix, notes=notes)
                    return None
            sizes = binding.sizes
        unique = self.unique("_".join([*map(str, sizes.values()), name]))
        if unique not in self.program.helpers:
            function = self._for_sizes(node, unique, sizes, span) if sizes else None
            if function is None:
                self._failed.add(name)
                return None
            self.program.helpers[unique] = function
        function = self.program.helpers[unique]
        assert function.result
        return Signature(unique, tuple(t for _, t in function.arguments), function.result, function.faults)

    def _for_sizes(self, node: ast.FunctionDef, unique: str, sizes: dict[str, int], span: Span) -> ir.Function | None:
        """A helper for these sizes. What is wrong in it is reported with the call that gave it the sizes."""
        sink = DiagnosticSink()
        function = check_function(self.declarations, node, unique, sizes, self.reporting_to(sink), sink)
        shown = ", ".join(f"{size} = {value}" for size, value in sizes.items())
        self.sink.extend(sink.diagnostics, Note(span, f"called here, with {shown}"))
        return function

    # ---- library ---------------------------------------------------------------------------------------------------

    def _library(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        nodes, binding = overloads(name), _Binding(TypeNames({}, {}))
        shown = " or ".join(_signature(name, node) for node in nodes)
        node = next((n for n in nodes if len(n.args.args) == len(arguments)), None)
        if node is None:
            counts = " or ".join(str(len(n.args.args)) for n in nodes)
            more = [o for o in (f"{name}2", f"{name}3") if self._takes(o, len(arguments))]
            shown = " or ".join(_signature(o, node) for o in more for node in overloads(o)) or shown
            self.sink.error("E416", f"`{name}` takes {counts} argument(s), not {len(arguments)}", span, help=shown)
            return None
        parameters = [(a.arg, _text(a.annotation)) for a in node.args.args]
        for (parameter, pattern), argument in zip(parameters, arguments, strict=True):
            problem = binding.unify(parameter, pattern, argument.type)
            if problem:
                fix = (_instead(name, pattern, argument.type) if len(arguments) == 1 else "") or shown
                self.sink.error("E418", f"`{name}`: {problem}", argument.span, help=fix)
                return None
        if not self._has_cells(name, node, arguments):
            return None
        other = [str(binding.element)] if binding.element not in (None, F64) else []
        unique = "_".join([LIBRARY_PREFIX, node.name, *other, *map(str, binding.sizes.values())])
        function = self.program.functions.get(unique) or self._sized(name, node, unique, binding, span)
        if function is None:
            return None
        self.program.functions[unique] = function
        assert function.result
        return Signature(unique, tuple(t for _, t in function.arguments), function.result, function.faults)

    def _takes(self, name: str, count: int) -> bool:
        return name in library_names() and any(len(node.args.args) == count for node in overloads(name))

    def _has_cells(self, name: str, node: ast.FunctionDef, arguments: list[ir.Expr]) -> bool:
        """Whether each axis of a table has two breakpoints. Only a search among them does with less."""
        for position in BREAKPOINTS.get(node.name, ()) if node.name != "interp_cell" else ():
            argument = arguments[position]
            if count_of(argument.type) < 2:
                parameter = node.args.args[position].arg
                message = f"`{name}`: {parameter} has one breakpoint, and a table two or more"
                fix = "add a breakpoint, or use the only value as a constant"
                self.sink.error("E418", message, argument.span, help=fix)
                return False
        return True

    def _sized(
        self, name: str, node: ast.FunctionDef, unique: str, binding: _Binding, span: Span
    ) -> ir.Function | None:
        """A library function for these sizes. Returns None after reporting that they are too large: the mistake is the
        call in the user's file, whichever line of the library finds it."""
        declarations, element = library()[node.name][0], binding.element
        node = of_elements(node, str(element)) if element is not None else node
        if self.declarations.owner == LIBRARY_PREFIX:
            table = FunctionTable(declarations, self.program, self.sink)
            return check_function(declarations, node, unique, binding.sizes, table, self.sink)
        sink = DiagnosticSink()
        table = FunctionTable(declarations, self.program, sink)
        function = check_function(declarations, node, unique, binding.sizes, table, sink)
        if function is None:
            found = sink.diagnostics[0]
            notes = [(found.span, "here, for arguments of these sizes")]
            fix = "use smaller arrays; for a large product, a loop over some of its rows in each tick"
            self.sink.error(found.code, f"`{name}`: {found.message}", span, why=found.why, help=fix, notes=notes)
        return function


def _instead(name: str, pattern: str, type_: Type) -> str:
    """What to write if the only argument is a mask instead of numbers, or a matrix instead of a vector; else ""."""
    element, extents = pattern.partition("[")[0], SIZE.findall(pattern)
    if len(extents) == 1 and len(shape_of(type_)) > 1 and element in (*ELEMENTS, "bool"):
        return f"it takes one dimension, so the rows one by one: `{name}(m[i])`"
    is_of_numbers = len(extents) == len(shape_of(type_)) == 1 and element in ELEMENTS
    return f"write `{name}(where(mask, 1.0, 0.0))`" if is_of_numbers and element_of(type_) is BOOL else ""


class _Binding:
    """Sizes, and the type of elements, that match a generic signature to the types of actual arguments."""

    def __init__(self, names: TypeNames) -> None:
        self.sizes: dict[str, int] = {}
        self.element: Scalar | None = None
        self._by: dict[str, str] = {}
        self._names = names

    def unify(self, parameter: str, pattern: str, type_: Type) -> str:
        """Binds the size variables of `pattern` to the sizes of `type_`. Returns the problem, or ""."""
        name, extents = pattern.partition("[")[0].strip(), SIZE.findall(pattern)
        element, shape = element_of(type_), shape_of(type_)
        if not extents and shape:
            return f"{parameter} is a scalar, not {type_}"
        if len(shape) != len(extents):
            return f"{parameter} is {pattern}, not {type_}"
        for text, extent in zip(extents, shape, strict=True):
            problem = self._size(parameter, text, extent, type_)
            if problem:
                return problem
        if name in ELEMENTS:
            return self._element(parameter, name, element)
        if element != (SCALARS.get(name) or self._names.structs.get(name)):
            return f"{parameter} is {pattern}, not {type_}"
        return ""

    def _element(self, parameter: str, name: str, element: Scalar | Struct) -> str:
        if element not in ELEMENTS[name]:
            return f"{parameter} is of {' or '.join(map(str, ELEMENTS[name]))}, not of {element}"
        assert isinstance(element, Scalar)
        if self.element in (None, element):
            self.element = element
            self._by.setdefault(name, parameter)
            return ""
        return f"{self._by[name]} is of {self.element}, but {parameter} of {element}"

    def _size(self, parameter: str, text: str, extent: int, type_: Type) -> str:
        fixed = int(text) if text.isdigit() else self._names.sizes.get(text)
        if fixed is not None:
            return "" if fixed == extent else f"{parameter} has size {text} here, not {extent} ({type_})"
        if text not in self.sizes:
            self.sizes[text] = extent
            self._by[text] = parameter
            return ""
        if self.sizes[text] == extent:
            return ""
        return f"size {text} is {self.sizes[text]} in {self._by[text]}, but {extent} in {parameter}"


def _signature(name: str, node: ast.FunctionDef) -> str:
    defaults = [""] * (len(node.args.args) - len(node.args.defaults)) + [
        f" = {ast.unparse(d)}" for d in node.args.defaults
    ]
    shown = (f"{a.arg}: {_text(a.annotation)}{d}" for a, d in zip(node.args.args, defaults, strict=True))
    return f"{name}({', '.join(shown)})"


def _element(annotation: ast.expr | None) -> Type | str:
    """The scalar type in an annotation of the library, or its name in ELEMENTS."""
    name = _text(annotation).partition("[")[0]
    return name if name in ELEMENTS else SCALARS[name]


def _text(annotation: ast.expr | None) -> str:
    if isinstance(annotation, ast.Constant):
        return str(annotation.value)
    return ast.unparse(annotation) if annotation else ""


# ---- one function --------------------------------------------------------------------------------------------------


def check_function(
    declarations: Declarations,
    node: ast.FunctionDef,
    unique: str,
    sizes: dict[str, int],
    table: FunctionTable,
    sink: DiagnosticSink,
) -> ir.Function | None:
    """Checks a helper or library function. Arguments and results are annotated values. Returns None after reporting an
    error."""
    source = declarations.source
    names = TypeNames({**declarations.names.sizes, **sizes}, declarations.names.structs)
    plain = check_plain(source, node, sink)
    arguments: dict[str, Type] = {}
    if node.args.args and node.args.args[0].arg == "self":
        why = "a helper is pure: values in, one value out"
        fix = "pass the fields that it needs"
        sink.error("E431", f"`{node.name}` takes `self`", span_of(source, node.args.args[0]), why=why, help=fix)
        declarations.wrong.add(node.name)  # its calls are not reported again
        return None
    for argument in node.args.args:
        at = span_of(source, argument)
        free = argument.arg in SHADOWABLE and not declarations.uses_library(argument.arg)
        if argument.arg in LANGUAGE_NAMES and not free:
            sink.error("E422", f"`{argument.arg}` is a name of the language", at, help="use another name")
            plain = False
            continue
        if argument.annotation is None:
            fix = f'such as `{argument.arg}: f64`, `{argument.arg}: "f64[3]"`'
            sink.error("E431", f"argument `{argument.arg}` has no type", at, help=fix)
            plain = False
            continue
        parsed = annotation_type(source, argument.annotation, names, False, sink)
        if parsed is None:
            plain = False
        else:
            arguments[argument.arg] = parsed[0]
    if node.returns is None or (isinstance(node.returns, ast.Constant) and node.returns.value is None):
        fix = 'such as `-> f64` or `-> "f64[3]"`'
        sink.error("E431", f"`{node.name}` has no result type", span_of(source, node), help=fix)
        return None
    result = result_type(source, node.returns, names, sink)
    if result is None or not plain:
        return None
    scope = Scope(
        source,
        declarations.constants,
        table,
        arguments,
        names,
        result,
        sizes,
        wrong=declarations.wrong,
        uses_library=declarations.uses_library,
    )
    before = sink.errors
    body = BodyChecker(scope, sink).function(node.body)
    if not scope.unreachable and sink.errors == before:
        fix = "end it with `return …`"
        sink.error("E432", f"`{node.name}` may end without a result", span_of(source, node), help=fix)
    if sink.errors != before:
        return None
    return ir.Function(
        unique,
        node.name,
        tuple(arguments.items()),
        (),
        result,
        tuple((n, t) for n, (t, _) in scope.types.items()),
        body,
        scope.faults,
        tuple(scope.calls),
        span_of(source, node),
        tuple(scope.requests.items()),
    )


def check_plain(source: SourceFile, node: ast.FunctionDef, sink: DiagnosticSink) -> bool:
    """Reports *args, keyword-only arguments, duplicate arguments and decorators, and then returns False."""
    a = node.args
    if a.kwonlyargs or a.vararg or a.kwarg or a.posonlyargs:
        sink.error(
            "E431",
            f"`{node.name}` has more than plain arguments",
            span_of(source, node),
            help="write `name: type = default`",
        )
        return False
    twice = next((b for n, b in enumerate(a.args) if b.arg in {c.arg for c in a.args[:n]}), None)
    if twice is not None:
        message = f"`{node.name}` has two arguments `{twice.arg}`"
        sink.error("E302", message, span_of(source, twice), help="rename one of the two")
        return False
    if node.decorator_list:
        fix = "remove it"
        sink.error("E410", "a decorator is not part of the language", span_of(source, node.decorator_list[0]), help=fix)
        return False
    return True
