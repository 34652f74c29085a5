# SPDX-License-Identifier: Apache-2.0
"""The numeric library: the compiler's sources (library/*.py).

A function is generic in the sizes of its arguments. Each combination of classes of arguments gets a function of its
own: without loops (unroll.py) or, for large arrays, after the same rewrite as for algorithms.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from .annotations import split_type
from .arrays import Array
from .infer import ELEMENTS, SELF, Kind, Names, annotation_text, kind_of
from .products import large_product
from .rewrite import Rewriter
from .runtime import runtime
from .unroll import PRODUCTS, Classes, TooLarge, unrolled
from .values import IllTyped

#: Files whose functions are not written without loops.
_WITH_LOOPS = ("arrays", "tables")
#: Arguments and result of every function of a file.
Signatures = dict[str, tuple[list[Kind], Kind]]


def signature(node: ast.FunctionDef, sizes: Mapping[str, int] | None = None) -> tuple[list[Kind], Kind]:
    """Kinds of the arguments and the result as annotated. A function without result has Kind("None")."""
    arguments = [kind_of(a.annotation, sizes) for a in node.args.args if a.annotation is not None]
    return arguments, kind_of(node.returns, sizes) if node.returns is not None else Kind("None")


def define(node: ast.FunctionDef, names: Names, extra: Mapping[str, Kind]) -> ast.FunctionDef:
    """The rewritten function without annotations. `extra`: additional constants it can use."""
    arguments, result = names.functions[node.name]
    known = {a.arg: kind for a, kind in zip(node.args.args, arguments, strict=True)}
    rewriter = Rewriter(
        replace(names, constants={**names.constants, **extra}), known, result if result.base != "None" else None
    )
    plain = [ast.copy_location(ast.arg(a.arg), a) for a in node.args.args]
    inner = ast.arguments([], plain, None, [], [], None, [])
    made = ast.FunctionDef(node.name, inner, rewriter.function(node.body), [])
    return ast.copy_location(made, node)


def method(node: ast.FunctionDef, names: Names, outside: Collection[str]) -> ast.FunctionDef:
    """The rewritten `start` or `execute`. `outside`: functions with effects, which must not be called twice."""
    rewriter = Rewriter(names, {"self": Kind(SELF)}, outside=outside)
    inner = ast.arguments([], [ast.copy_location(ast.arg("self"), node)], None, [], [], None, [])
    return ast.copy_location(ast.FunctionDef(node.name, inner, rewriter.function(node.body), []), node)


def execute(body: list[ast.stmt], path: str, namespace: dict[str, Any]) -> None:
    """Executes rewritten statements as part of the file `path`."""
    tree = ast.fix_missing_locations(ast.Module(body, []))
    exec(compile(tree, path, "exec"), namespace)


class Sized:
    """A function that is generic in the sizes of its arguments. Each combination of sizes gets a function of its own."""

    def __init__(self, node: ast.FunctionDef, names: Names, path: str):
        self._node, self._names, self._path = node, names, path
        self._extents = [list(kind.shape) for kind in names.functions[node.name][0]]
        self._made: dict[tuple[Any, ...], Callable[..., Any]] = {}

    def __call__(self, *args: Any) -> Any:
        shapes = tuple(arg.shape if isinstance(arg, Array) else () for arg in args)
        if shapes not in self._made:
            self._made[shapes] = self._for(bind_sizes(self._node.name, self._extents, shapes))
        return self._made[shapes](*args)

    def _for(self, sizes: Mapping[str, int]) -> Callable[..., Any]:
        namespace = {**self._names.values, **sizes}
        functions = {**self._names.functions, self._node.name: signature(self._node, sizes)}
        names = replace(self._names, functions=functions, values=namespace, literals=dict(self._names.literals))
        made = define(self._node, names, {size: Kind("int") for size in sizes})
        namespace.update(names.literals)
        execute([made], self._path, namespace)
        function: Callable[..., Any] = namespace[self._node.name]
        return function


class Library:
    """All library functions. `functions` are generic; `signatures` are theirs."""

    def __init__(self) -> None:
        paths = sorted((Path(__file__).parent.parent / "library").glob("*.py"))
        files = {path: path.read_text("utf-8") for path in paths}
        found = [
            (path, n) for path, text in files.items() for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)
        ]
        self._nodes = {node.name: node for _, node in found}
        self._files = {node.name: path for path, node in found}
        self._texts = files
        self._names = runtime({})
        self._made: dict[tuple[str, Classes, bool], Callable[..., Any]] = {}
        self.signatures: Signatures = {name: signature(node) for name, node in self._nodes.items()}
        self.functions: dict[str, Callable[..., Any]] = {name: self._generic(name) for name in self._nodes}
        self._names.update(self.functions)

    def makers(self) -> dict[str, Callable[..., Callable[..., Any]]]:
        """By name, what returns a function for the classes of its arguments."""
        return {name: lambda *classes, name=name: self._function(name, classes) for name in self._nodes}

    def _generic(self, name: str) -> Callable[..., Any]:
        """The function for any sizes."""
        special: dict[Classes, Callable[..., Any]] = {}

        def call(*args: Any) -> Any:
            classes = tuple(map(type, args))
            found = special.get(classes)
            if found is None:
                found = special[classes] = self._function(name, classes)
            return found(*args)

        return call

    def _function(self, name: str, classes: Classes, plain: bool = False) -> Callable[..., Any]:
        """The function for arguments of these classes, made at its first use. `plain`: of numbers in the place of
        arrays."""
        key = name, classes, plain
        if key not in self._made:
            shapes = [cls.shape if issubclass(cls, Array) else () for cls in classes]
            bind_sizes(name, [split_type(pattern)[1] for pattern in self._patterns(name)], shapes)
            try:
                self._made[key] = self._unrolled(name, classes, plain)
            except TooLarge:
                if plain:
                    raise
                self._made[key] = self._with_loops(name, classes)
        return self._made[key]

    def _patterns(self, name: str) -> list[str]:
        return [annotation_text(a.annotation) for a in self._nodes[name].args.args if a.annotation is not None]

    def _unrolled(self, name: str, classes: Classes, plain: bool) -> Callable[..., Any]:
        if self._files[name].stem in _WITH_LOOPS or any(_element(cls) != "f64" for cls in classes):
            raise TooLarge
        node, needed = unrolled(name, classes, self._nodes, self._separate, plain=plain)
        namespace = {**self._names, **needed}
        execute([node], str(self._files[name]), namespace)
        function: Callable[..., Any] = namespace[name]
        return function

    def _separate(self, name: str, classes: Classes) -> str:
        label = f"fcsl.{name} {[(cls.__name__, getattr(cls, 'zeros', None)) for cls in classes]}"
        self._names[label] = self._function(name, classes, plain=True)
        return label

    def _with_loops(self, name: str, classes: Classes) -> Callable[..., Any]:
        """The function as it is written, for arrays that are too large."""
        if name in PRODUCTS:
            return partial(large_product, symmetric=name == "symmetric_product")
        path = self._files[name]
        pairs = zip(classes, self._patterns(name), strict=True)
        elements = [_element(cls) for cls, pattern in pairs if split_type(pattern)[0] in ELEMENTS]
        node = _of_elements(self._nodes[name], elements[0]) if elements else self._nodes[name]
        functions = {**self.signatures, name: signature(node)}
        names = Names({}, functions, text=self._texts[path], values=dict(self._names), library=self.makers())
        function = Sized(node, names, str(path))
        constant = name == "transpose" and classes[0].zeros is not None
        return (lambda a: function(a).as_constant()) if constant else function


def _element(cls: type[Any]) -> str:
    """The type of a number, or of the elements of an array, as the language names it."""
    if issubclass(cls, Array):
        return cls.type.name
    return "f64" if cls is float else cls.__name__.lower()


def _of_elements(node: ast.FunctionDef, element: str) -> ast.FunctionDef:
    """The function for elements of this type, in the place of F or T."""
    made = copy.deepcopy(node)
    for annotation in (*(a.annotation for a in made.args.args), made.returns):
        assert isinstance(annotation, ast.Constant)
        text = str(annotation.value)
        name = split_type(text)[0]
        if name in ELEMENTS:
            annotation.value = text.replace(name, element, 1)
    return made


@cache
def library() -> Library:
    return Library()


def bind_sizes(name: str, extents: Sequence[Sequence[int | str]], shapes: Sequence[tuple[int, ...]]) -> dict[str, int]:
    """Sizes that match the declared shapes. Raises IllTyped."""
    sizes: dict[str, int] = {}
    for declared, shape in zip(extents, shapes, strict=True):
        for extent, size in zip(map(str, declared), shape, strict=True):
            if (int(extent) if extent.isdigit() else sizes.setdefault(extent, size)) != size:
                raise IllTyped(f"{name} of arguments with shapes {shapes}")
    return sizes
