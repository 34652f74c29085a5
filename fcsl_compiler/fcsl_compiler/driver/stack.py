# SPDX-License-Identifier: Apache-2.0
"""Worst-case stack of a machine's step: the frame sizes that gcc reports, summed along the call graph."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

#: Stack in bytes of a leaf function of libc or libm (memcpy, fma, …), whose frame size is not reported, and of the red
#: zone below the stack pointer (x86-64). `make verify` compares LEAF_BYTES with the code of every function that
#: symbols.py allows.
LEAF_BYTES = 256
RED_ZONE_BYTES = 128

_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \(([\w,]+)\)(?:\\n(\d+) dynamic objects)?')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
#: Calls through a pointer: the host's clock and hardware functions. The host accounts for their stack.
_INDIRECT = "__indirect_call"


#: A bound above it comes with a warning: an eighth of what the main thread has by default, and more than many threads.
_LARGE_BYTES = 1 << 20
_STEP = re.compile(r'node: \{ title: "[^"]*:fcsl_step_(\w+)"')


def stepped_machines(graphs: Iterable[Path]) -> list[str]:
    """Names of the machines whose step is in these call graphs, sorted."""
    return sorted({n for graph in graphs for n in _STEP.findall(graph.read_text(errors="replace"))})


def bound_text(machine: str, bound: int, externs: Sequence[str] = ()) -> str:
    """Text for users: a bound, its assumption, and the externs it excludes."""
    text = f"{machine}: a step needs at most {bound} bytes of stack ({LEAF_BYTES} assumed where it calls libc or libm)"
    text += f", without its externs: {', '.join(externs)}" if externs else ""
    if bound > _LARGE_BYTES:
        text += (
            f"\n{machine}: warning: that is more than {_LARGE_BYTES} bytes. Hosts refuse it where a thread has no more: make "
            "the arrays smaller that helpers copy"
        )
    return text


def stack_bound(machine: str, graphs: Iterable[Path], externs: Iterable[str] = ()) -> int | None:
    """Stack of step in bytes, without its externs and the host's functions. None if the call graph gives no bound."""
    frames: dict[str, int] = dict.fromkeys(externs, 0)
    calls: dict[str, set[str]] = {}
    for graph in graphs:
        for line in graph.read_text(errors="replace").splitlines():
            node, edge = _NODE.match(line), _EDGE.match(line)
            if node:
                if "static" not in node[3] and "bounded" not in node[3] or int(node[4] or 0):
                    return None
                frames[node[1]] = int(node[2])
            elif edge:
                calls.setdefault(edge[1], set()).add(edge[2])
    entry = next((n for n in frames if n.endswith(f":fcsl_step_{machine}")), None)
    depth = _deepest(entry, frames, calls, {}, ()) if entry else None
    return None if depth is None else depth + RED_ZONE_BYTES


def folded(name: str, functions: Iterable[str]) -> list[str]:
    """Functions that may be identical to a static one without a node. gcc merges functions with equal code and does not
    report which."""
    file, colon, _ = name.rpartition(":")
    return [other for other in functions if colon and other.rpartition(":")[0] == file]


def _deepest(
    name: str, frames: dict[str, int], calls: dict[str, set[str]], known: dict[str, int], above: tuple[str, ...]
) -> int | None:
    if name in above:
        return None
    if name == _INDIRECT:
        return 0
    if name not in frames:
        depths = [_deepest(other, frames, calls, known, above) for other in folded(name, frames) if other not in above]
        return max([LEAF_BYTES, *(d for d in depths if d is not None)])
    if name not in known:
        deepest = 0
        for callee in calls.get(name, ()):
            below = _deepest(callee, frames, calls, known, (*above, name))
            if below is None:
                return None
            deepest = max(deepest, below)
        known[name] = frames[name] + deepest
    return known[name]
