# SPDX-License-Identifier: Apache-2.0
"""What gcc says of a machine's calls, and what the instructions say, and whether both stay within the machine.

A call through a pointer is allowed where the source line calls the host's table (clock, hardware, substitute), nowhere else.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fcsl_compiler.driver.stack import folded
from fcsl_compiler.driver.symbols import ALLOWED

from ..shared.cases import CheckFailed, run
from .build import Binary, sources_of
from .calls import Closure, closure
from .code import Code
from .elf import Elf

#: The functions of fcsl_host_t and struct fcsl_hw, as C calls them and as the C that Nim makes does.
_HOST_CALL = re.compile(
    r"(?:->|\(\*host\)\.)(clock_ns|substitute|executed|measure|read_gpio|write_gpio|read_adc|read_u32|write_u32)\("
)
_INDIRECT = "__indirect_call"
_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*\\n\d+ bytes \(([\w,]+)\)(?:\\n(\d+) dynamic objects)?')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)" label: "([^"]+)"')
_ENTRIES = ("init", "start", "step", "force_state")


@dataclass(frozen=True)
class Calls:
    """`host` has one name for each place that calls the host's table. `bounds`: bytes for init, start, step, force_state.

    `chain`: functions in the longest chain of calls.
    """

    functions: int
    chain: int
    host: list[str]
    imports: list[str]
    bounds: dict[str, int]


def check_graph(binary: Binary) -> Calls:
    """By gcc's graphs. Raises CheckFailed: recursion, a frame of unknown size, a call of something unknown."""
    frames: dict[str, bool] = {}
    calls: dict[str, list[tuple[str, str]]] = {}
    for graph in binary.graphs:
        for line in graph.read_text(errors="replace").splitlines():
            node, edge = _NODE.match(line), _EDGE.match(line)
            if node:
                # "bounded": it pushes arguments of calls, by an amount that gcc knows.
                frames[node[1]] = node[2] in ("static", "dynamic,bounded") and not int(node[3] or 0)
            elif edge:
                calls.setdefault(edge[1], []).append((edge[2], edge[3]))
    known = ALLOWED | set(binary.externs)
    reached: dict[str, int] = {}
    imports: set[str] = set()
    host: list[str] = []

    def calls_any(name: str, others: set[str]) -> bool:
        """Whether a function is one of these, or calls one, directly or not."""
        return name in others or any(calls_any(callee, others) for callee, _ in calls.get(name, ()) if callee in frames)

    def visit(name: str, above: tuple[str, ...]) -> int:
        if name in above:
            raise CheckFailed(f"recursion: {' calls '.join([*above[above.index(name) :], name])}")
        if name in reached:
            return reached[name]
        if not frames[name]:
            raise CheckFailed(f"{name} has a frame whose size is known when it runs")
        below = 0
        for callee, place in calls.get(name, []):
            if callee == _INDIRECT:
                host.append(place)
            elif callee in frames:
                below = max(below, visit(callee, (*above, name)))
            elif callee in known:
                imports.add(callee)
                below = max(below, 1)
            elif folded(callee, frames):
                same = [f for f in folded(callee, frames) if not calls_any(f, {*above, name})]
                below = max([below, *(visit(f, (*above, name)) for f in same)])
            else:
                raise CheckFailed(f"{name} calls {callee}")
        reached[name] = 1 + below
        return reached[name]

    chain = max(visit(_only(frames, f":fcsl_{entry}_{binary.machine}"), ()) for entry in _ENTRIES)
    return Calls(len(reached), chain, host_calls(host), sorted(imports), {"step": binary.bound} if binary.bound else {})


def _only(names: dict[str, bool], end: str) -> str:
    found = [n for n in names if n.endswith(end)]
    if len(found) != 1:
        raise CheckFailed(f"gcc's graphs have {len(found)} functions {end[1:]}")
    return found[0]


def check_code(binary: Binary, leaf_bytes: Callable[[str], int]) -> Calls:
    """By the instructions of the library. Raises CheckFailed, as check_graph does; also for a way into the kernel."""
    elf = Elf(binary.library)
    places = {s.name: s.address for s in elf.symbols if s.kind == "FUNC"}
    wanted = {entry: places.get(f"fcsl_{entry}_{binary.machine}") for entry in _ENTRIES}
    entries = {entry: address for entry, address in wanted.items() if address is not None}
    if len(entries) < len(_ENTRIES):
        raise CheckFailed(f"{binary.library.name} lacks {', '.join(sorted(set(wanted) - set(entries)))}")
    found = closure(Code(elf), list(entries.values()), leaf_bytes)
    host = host_calls(_lines(binary, found))
    bounds = {entry: found.bounds[address] for entry, address in entries.items()}
    return Calls(len(found.functions), max(found.chains.values()), host, found.imports, bounds)


def _lines(binary: Binary, found: Closure) -> list[str]:
    """file:line of every call through a pointer."""
    if not found.indirect:
        return []
    return run(["addr2line", "-e", binary.lined, *map(hex, found.indirect)]).splitlines()


def host_calls(places: Sequence[str]) -> list[str]:
    """What each of these source places calls of the host's table. Raises CheckFailed where one calls something else."""
    names = []
    for place, text in zip(places, sources_of(places), strict=True):
        match = _HOST_CALL.search(text)
        if match is None:
            raise CheckFailed(f"a call through a pointer that is not the host's: {place}: `{text}`")
        names.append(match[1])
    return names
