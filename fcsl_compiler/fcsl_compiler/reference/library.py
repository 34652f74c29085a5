# SPDX-License-Identifier: Apache-2.0
"""The numeric library: the compiler's sources (library/*.py) after the same rewrite as for algorithms.

A function is generic in the sizes of its arguments. Each combination of sizes gets a separate function whose globals
bind the size variables.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import cache, reduce
from pathlib import Path
from types import FunctionType
from typing import Any

from .annotations import split_type
from .arrays import Array, array_type
from .infer import SELF, Kind, Names, annotation_text, kind_of
from .rewrite import Rewriter
from .runtime import runtime
from .values import IllTyped

#: Functions that omit products with zeros of a constant array.
_PRODUCTS = ("matmul", "matvec", "symmetric_product")

#: Arguments and result of every function of a file.
Signatures = dict[str, tuple[list[Kind], Kind]]


def signature(node: ast.FunctionDef) -> tuple[list[Kind], Kind]:
    """Kinds of the arguments and the result as annotated. A function without result has Kind("None")."""
    arguments = [kind_of(a.annotation) for a in node.args.args if a.annotation is not None]
    return arguments, kind_of(node.returns) if node.returns is not None else Kind("None")


def define(node: ast.FunctionDef, names: Names, extra: Mapping[str, Kind]) -> ast.FunctionDef:
    """The rewritten function without annotations. `extra`: additional constants it can use."""
    arguments, result = signature(node)
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


@cache
def library() -> tuple[dict[str, Any], Signatures]:
    """All library functions by name, and their signatures."""
    paths = sorted((Path(__file__).parent.parent / "library").glob("*.py"))
    files = {path: path.read_text("utf-8") for path in paths}
    found = [(path, n) for path, text in files.items() for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)]
    signatures: Signatures = {f.name: signature(f) for _, f in found}
    shared = runtime({})
    functions: dict[str, Any] = {}
    for path, node in found:
        patterns = [annotation_text(a.annotation) for a in node.args.args if a.annotation is not None]
        sizes = {e for pattern in patterns for e in split_type(pattern)[1] if not e.isdigit()}
        names = Names({}, signatures, text=files[path])
        made = define(node, names, {size: Kind("int") for size in sizes})
        shared.update(names.literals)
        execute([made], str(path), shared)
        functions[node.name] = shared[node.name] = _generic(shared[node.name], patterns)
    return functions, signatures


def _generic(function: FunctionType, patterns: list[str]) -> Callable[..., Any]:
    """The function for the sizes of its arguments, created at the first call."""
    extents = [split_type(pattern)[1] for pattern in patterns]
    special: dict[tuple[tuple[int, ...], ...], FunctionType] = {}

    def call(*args: Any) -> Any:
        if function.__name__ in _PRODUCTS and any(arg.zeros for arg in args):
            return _skipping_zeros(*args, symmetric=function.__name__ == "symmetric_product")
        shapes = tuple([arg.shape if isinstance(arg, Array) else () for arg in args])
        found = special.get(shapes)
        if found is None:
            sizes = _bind(function.__name__, extents, shapes)
            found = special[shapes] = FunctionType(function.__code__, {**function.__globals__, **sizes})
        result = found(*args)
        return result.as_constant() if function.__name__ == "transpose" and args[0].zeros else result

    return call


def _skipping_zeros(a: Array, b: Array, *, symmetric: bool) -> Array:
    """matmul, matvec or symmetric_product with a constant argument: products with its zeros are omitted; an empty sum
    is 0."""
    (rows, inner), columns = a.shape, b.shape[1:]
    width = columns[0] if columns else 1
    if b.shape[0] != inner or symmetric and width != rows:
        raise IllTyped(f"a product of arrays with shapes {a.shape} and {b.shape}")
    data: list[Any] = []
    for i in range(rows):
        for j in range(width):
            if symmetric and j < i:
                data.append(data[j * width + i])
                continue
            pairs = [(a.data[i * inner + p], b.data[p * width + j]) for p in range(inner)]
            products = [x * y for x, y in pairs if not (a.zeros and x == 0.0 or b.zeros and y == 0.0)]
            data.append(reduce(operator.add, products) if products else 0.0)
    return array_type(a.type, (rows, *columns)).of(data)


def _bind(name: str, extents: list[list[str]], shapes: tuple[tuple[int, ...], ...]) -> dict[str, int]:
    """Sizes that match the declared shapes. Raises IllTyped."""
    sizes: dict[str, int] = {}
    for declared, shape in zip(extents, shapes, strict=True):
        for extent, size in zip(declared, shape, strict=True):
            if (int(extent) if extent.isdigit() else sizes.setdefault(extent, size)) != size:
                raise IllTyped(f"{name} of arguments with shapes {shapes}")
    return sizes
