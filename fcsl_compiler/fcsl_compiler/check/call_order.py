# SPDX-License-Identifier: Apache-2.0
"""Orders the helpers of a file for checking, callees first. Uses no recursion."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping

#: For each function, the functions it calls, each with its first call, in source order.
CallGraph = dict[str, dict[str, ast.Call]]


def call_graph(functions: Mapping[str, ast.FunctionDef]) -> CallGraph:
    """The calls between the given functions."""
    graph: CallGraph = {}
    for name, node in functions.items():
        calls = [n for n in ast.walk(node) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
        callees = graph.setdefault(name, {})
        for call in sorted(calls, key=lambda c: (c.lineno, c.col_offset)):
            assert isinstance(call.func, ast.Name)
            if call.func.id in functions:
                callees.setdefault(call.func.id, call)
    return graph


def call_order(graph: CallGraph, roots: Iterable[str]) -> tuple[list[str], list[tuple[list[str], ast.Call]]]:
    """Returns all functions reachable from the roots, callees first, and the cycles. A cycle is a chain of names and
    the call that closes it."""
    order: list[str] = []
    cycles: list[tuple[list[str], ast.Call]] = []
    done: set[str] = set()
    for root in roots:
        path: list[str] = []  # current chain of calls, from the root
        waiting = [] if root in done else [(root, iter(graph[root].items()))]
        path += [root] if waiting else []
        while waiting:
            name, callees = waiting[-1]
            callee, call = next(callees, ("", None))
            if call is None:
                waiting.pop()
                path.pop()
                done.add(name)
                order.append(name)
            elif callee in path:
                cycles.append(([*path[path.index(callee) :], callee], call))
            elif callee not in done:
                waiting.append((callee, iter(graph[callee].items())))
                path.append(callee)
    return order, cycles
