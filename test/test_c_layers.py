# SPDX-License-Identifier: Apache-2.0
"""Includes of C point one way: between packages, between the folders of a package, and between files."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
_RUNTIME = "fcsl_runtime/fcsl_runtime"


@dataclass(frozen=True)
class Package:
    """`layers`: folders, each of which may include its own files and those below it in this table, with the public headers
    (`include/fcsl`) that belong to it. A public header stands with the lowest folder that may include it. `searched`: where
    the compiler looks for private headers. Tests may include anything, so `unchecked` are the folders of tests."""

    layers: Mapping[str, Sequence[str]]
    searched: Sequence[str] = ("src",)
    unchecked: Sequence[str] = ("test",)


#: By folder, top to bottom: each may include public headers of those below it, and no private ones.
PACKAGES = {
    "fcsl_sim": Package(
        {
            "src/opening": (),
            "src/hosting": (),
            "src/checkpoints": (),
            "src/output": (),
            "src/engine": ("fcsl_sim.h",),
            "src/controllers": ("fcsl_serial_link.h",),
            "src/groups": (),
            "src/plant": (),
            "src/models": ("fcsl_model.h", "fcsl_model.hpp"),
            "src/plan": (),
            "src/integrators": (),
            "src/base": (),
        },
        unchecked=("test", "models", "rust"),
    ),
    _RUNTIME: Package(
        {
            "guard": (),
            "fc": (),
            "lockstep": ("fcsl_lockstep.h",),
            "board": (),
            "ros_graph": ("fcsl_ros_graph.h",),
            "observers": ("fcsl_observers.h",),
            "src/telemetry": ("fcsl_telemetry.h",),
            "src/vars": ("fcsl_vars.h",),
            "src/ros": ("fcsl_publish_queue.h", "fcsl_sample_input.h", "fcsl_service_input.h", "fcsl_topics.h"),
            "src/expression": ("fcsl_expression.h",),
            "src/history": ("fcsl_history.h", "fcsl_tick_stats.h"),
            "src/run": ("fcsl_fp_mode.h", "fcsl_library.h"),
            "src/parameters": (),
            "src/record": ("fcsl_bag.h", "fcsl_write_queue.h", "fcsl_mcap_records.h"),
            "src/messages": ("fcsl_cdr.h",),
            "src/machine": (),
            "src/base": ("fcsl_exit_within.h", "fcsl_histogram.h", "fcsl_parameters.h", "fcsl_run.h"),
        },
        searched=("src", ".", "fc"),
    ),
    "fcsl_hal": Package(
        {
            "firmware": (),
            "src/hal": ("fcsl_external.h", "fcsl_hal.h", "fcsl_hw_sim.h"),
            "src/named_values": ("fcsl_tick_publisher.h",),
            "src/transport": ("fcsl_wire.h",),
            "src/guard": ("fcsl_gate.h", "fcsl_guard.h"),
            "src/drivers": (),
            "src/frontends": ("fcsl_frontend.h",),
            "src/serial": (),
            "src/sysfs": (),
            "io": ("fcsl_mcap_writer.h",),
            "src/bus": ("fcsl_bus.h",),
            "src/link": ("fcsl_cobs.h", "fcsl_link.h"),
            "src/ros": ("fcsl_ros.h",),
            "src/codec": ("fcsl_codec.h",),
            "src/queues": ("fcsl_latest.h", "fcsl_seqlock.h"),
            "src/base": (
                "fcsl_address.h",
                "fcsl_channels.h",
                "fcsl_driver.h",
                "fcsl_error.h",
                "fcsl_log.h",
                "fcsl_monotonic.h",
                "fcsl_plan_text.h",
                "fcsl_scalar.h",
                "fcsl_socket.h",
                "fcsl_tick_time.h",
            ),
        },
        searched=("src", "firmware"),
    ),
    "fcsl_compiler": Package(
        {
            "include": (
                *("fcsl_cover.h", "fcsl_event.h", "fcsl_exact_math.h", "fcsl_hw.h", "fcsl_machine.h", "fcsl_math.h"),
                "fcsl_monitor.h",
                "fcsl_ros_conversion.h",
            )
        },
        unchecked=("test", "math", "build", "bare_metal"),
    ),
}
INCLUDE = re.compile(r'\s*#\s*include\s*([<"])([^>"]+)[>"]')


@dataclass(frozen=True)
class Include:
    """`to` is null where no file of that name may be included."""

    file: str
    line: int
    name: str
    to: str | None


class Tree:
    """The C of a workspace. Names of files are relative to it."""

    def __init__(self, root: Path):
        self._root = root
        #: The folders of all tables, bottom to top.
        self._order = [f"{p}/{folder}" for p, package in PACKAGES.items() for folder in package.layers][::-1]

    @cached_property
    def files(self) -> dict[str, str]:
        """Each with the folder of a table to which it belongs, or "" if none."""
        found = {}
        for name, package in PACKAGES.items():
            top = self._root / name
            for path in sorted(p for p in top.rglob("*") if p.suffix in {".c", ".h", ".hpp"}):
                inside = path.relative_to(top)
                if inside.parts[0] not in package.unchecked:
                    layer = next((folder for folder in package.layers if _belongs(inside, folder, package)), None)
                    found[f"{name}/{inside}"] = f"{name}/{layer}" if layer is not None else ""
        return found

    def listed(self) -> set[str]:
        """Folders and public headers of the tables."""
        headers = {
            f"{p}/include/fcsl/{h}" for p, package in PACKAGES.items() for hs in package.layers.values() for h in hs
        }
        return headers.union(self._order)

    def includes(self) -> Iterator[Include]:
        """Those of the system's headers excepted."""
        for file in self.files:
            for number, line in enumerate((self._root / file).read_text(encoding="utf-8").splitlines(), 1):
                if (match := INCLUDE.match(line)) and (match[1] == '"' or match[2].startswith("fcsl/")):
                    yield Include(file, number, match[2], self._find(file, match[2]))

    def _find(self, file: str, name: str) -> str | None:
        own = next(p for p in PACKAGES if file.startswith(f"{p}/"))
        folders = [str(Path(file).parent), *(str(Path(own, folder)) for folder in PACKAGES[own].searched)]
        folders += [f"{package}/include" for package in PACKAGES]
        return next((found for folder in folders if (found := f"{folder}/{name}") in self.files), None)

    def is_upward(self, include: Include) -> bool:
        folder, above = self.files[include.file], self.files.get(include.to or "", "")
        return bool(folder and above) and self._order.index(above) > self._order.index(folder)


def _belongs(file: Path, folder: str, package: Package) -> bool:
    if file.parts[0] == "include":
        return file.name in package.layers[folder]
    return Path(folder) in file.parents


def unit(file: str) -> str:
    """A C file and the header of its name are one."""
    return str(Path(file).with_suffix(""))


#: Units that units include, with an include of each.
Graph = Mapping[str, Mapping[str, Include]]


def graph_of(includes: Sequence[Include]) -> Graph:
    graph: dict[str, dict[str, Include]] = {unit(i.file): {} for i in includes}
    for i in includes:
        if i.to is not None and unit(i.to) != unit(i.file):
            graph[unit(i.file)].setdefault(unit(i.to), i)
    return graph


def way(graph: Graph, begin: str, end: str) -> list[Include]:
    """The shortest chain of includes from a unit to another or, round a circle, to itself; empty if there is none."""
    came: dict[str, Include] = {}
    waiting = [begin]
    for at in waiting:
        for to, include in graph.get(at, {}).items():
            if to not in came:
                came[to] = include
                waiting.append(to)
    chain: list[Include] = []
    while end in came and (not chain or end != begin):
        chain.insert(0, came[end])
        end = unit(came[end].file)
    return chain


def circles(graph: Graph) -> list[list[Include]]:
    """The shortest circle of each unit that is in one, and each circle once."""
    found = {frozenset(chain): chain for start in graph if (chain := way(graph, start, start))}
    return list(found.values())


def violations(root: Path) -> list[str]:
    """What is against the rules in the workspace at `root`."""
    tree = Tree(root)
    includes = list(tree.includes())
    said = [f"{file} stands in no folder of the table" for file, folder in tree.files.items() if not folder]
    said += [
        f"{name} of the table does not exist" for name in sorted(tree.listed() - {*tree.files, *tree.files.values()})
    ]
    for i in includes:
        if i.to is None:
            said.append(f"{i.file}:{i.line}: {i.name} is neither a public header nor a file of this package")
        elif tree.is_upward(i):
            folder, above = tree.files[i.file], tree.files[i.to]
            said.append(f"{i.file}:{i.line}: {folder} may not include {i.to}: {above} stands above it")
    for circle in circles(graph_of(includes)):
        said.append("a circle: " + ", ".join(f"{i.file}:{i.line} includes {i.to}" for i in circle))
    return said


def test_includes_point_down() -> None:
    assert violations(ROOT) == []


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """The C of this workspace, to seed defects in."""
    for file in Tree(ROOT).files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / file, tmp_path / file)
    return tmp_path


def put_first(root: Path, file: str, *headers: str) -> None:
    """Includes headers in the first lines of a file, which need not exist."""
    path = root / file
    path.parent.mkdir(exist_ok=True)
    text = path.read_text() if path.exists() else ""
    path.write_text("".join(f'#include "{header}"\n' for header in headers) + text)


SEEDED = {
    "upwards": (
        "fcsl_hal/src/base/log.c",
        "bus/bus_ring.h",
        "fcsl_hal/src/base may not include fcsl_hal/src/bus/bus_ring.h: fcsl_hal/src/bus stands above it",
    ),
    "a public header of a folder above": (
        "fcsl_hal/src/codec/codec.c",
        "fcsl/fcsl_wire.h",
        "fcsl_hal/src/codec may not include fcsl_hal/include/fcsl/fcsl_wire.h: fcsl_hal/src/transport stands above it",
    ),
    "a public header that includes upwards": (
        "fcsl_hal/include/fcsl/fcsl_codec.h",
        "fcsl/fcsl_gate.h",
        "fcsl_hal/src/codec may not include fcsl_hal/include/fcsl/fcsl_gate.h: fcsl_hal/src/guard stands above it",
    ),
    "a package above": (
        "fcsl_hal/src/hal/hal_stub.c",
        "fcsl/fcsl_run.h",
        f"fcsl_hal/src/hal may not include {_RUNTIME}/include/fcsl/fcsl_run.h: {_RUNTIME}/src/base stands above it",
    ),
    "a program": (
        f"{_RUNTIME}/board/board.c",
        "fc/log.h",
        f"{_RUNTIME}/board may not include {_RUNTIME}/fc/log.h: {_RUNTIME}/fc stands above it",
    ),
    "a private header of another package": (
        "fcsl_sim/src/engine/tick.c",
        "base/crc_table.h",
        "base/crc_table.h is neither a public header nor a file of this package",
    ),
    "support of tests": (
        "fcsl_hal/src/hal/hal_stub.c",
        "fcsl_check.h",
        "fcsl_check.h is neither a public header nor a file of this package",
    ),
}


@pytest.mark.parametrize("what", SEEDED)
def test_a_forbidden_include_is_found(copied: Path, what: str) -> None:
    file, header, wanted = SEEDED[what]
    put_first(copied, file, header)
    assert f"{file}:1: {wanted}" in violations(copied)


def test_a_circle_is_found(copied: Path) -> None:
    """Between files of one folder, through a C file: link_frame.c and link_frame.h are one."""
    put_first(copied, "fcsl_hal/src/link/link_frame.c", "link_port.h")
    (found,) = violations(copied)
    assert sorted(found.removeprefix("a circle: ").split(", ")) == [
        "fcsl_hal/src/link/link_frame.c:1 includes fcsl_hal/src/link/link_port.h",
        "fcsl_hal/src/link/link_port.h:8 includes fcsl_hal/src/link/link_frame.h",
    ]


def test_a_longer_circle_is_found(copied: Path) -> None:
    put_first(copied, "fcsl_hal/src/transport/line.h", "a.h")
    put_first(copied, "fcsl_hal/src/transport/a.h", "b.h", "fcsl/fcsl_wire.h")
    put_first(copied, "fcsl_hal/src/transport/b.c", "line.h")
    put_first(copied, "fcsl_hal/src/transport/b.h")
    (found,) = violations(copied)
    assert found.count(" includes ") == 3 and "fcsl_hal/src/transport/b.c:1 includes" in found


def test_a_folder_and_a_header_outside_of_the_table_are_found(copied: Path) -> None:
    put_first(copied, "fcsl_hal/src/attic/old.c", "fcsl/fcsl_bus.h")
    put_first(copied, "fcsl_hal/include/fcsl/fcsl_attic.h")
    assert violations(copied) == [
        f"fcsl_hal/{file} stands in no folder of the table" for file in ("include/fcsl/fcsl_attic.h", "src/attic/old.c")
    ]


def test_a_folder_and_a_header_that_are_gone_are_found(copied: Path) -> None:
    shutil.rmtree(copied / _RUNTIME / "lockstep")
    (copied / _RUNTIME / "include/fcsl/fcsl_lockstep.h").unlink()
    assert violations(copied) == [
        f"{_RUNTIME}/{name} of the table does not exist" for name in ("include/fcsl/fcsl_lockstep.h", "lockstep")
    ]
