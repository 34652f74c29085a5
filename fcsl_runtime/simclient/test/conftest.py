# SPDX-License-Identifier: Apache-2.0
"""Machines to test with: `probe` builds test/machines/probe.c, written by hand against the ABI."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from twin_craft import CONFIG, SENSORS, WATCH

from simclient import Twin
from simclient.twin.pytest_twins import twin_class

ROOT = Path(__file__).resolve().parents[3]
CFLAGS = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared"]


def builder(name: str, folder: Path) -> Callable[..., Path]:
    """Builds test/machines/NAME.c with the given macros, once per set of them."""
    built: dict[tuple[str, ...], Path] = {}

    def build(*macros: str) -> Path:
        if macros not in built:
            library = folder / str(len(built)) / f"lib{name}.so"
            library.parent.mkdir()
            source = ROOT / f"fcsl_runtime/simclient/test/machines/{name}.c"
            include = ROOT / "fcsl_compiler/include"
            flags = [*CFLAGS, f"-I{include}", *(f"-D{macro}" for macro in macros)]
            subprocess.run(["cc", *flags, str(source), "-o", str(library)], check=True)
            built[macros] = library
        return built[macros]

    return build


@pytest.fixture(scope="session")
def build_probe(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    return builder("probe", tmp_path_factory.mktemp("probe"))


@pytest.fixture(scope="session")
def build_guarded(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """The machine of tests of fcsl-guard."""
    return builder("guarded", tmp_path_factory.mktemp("guarded"))


@pytest.fixture(scope="session")
def probe(build_probe: Callable[..., Path]) -> Path:
    """The probe machine's library."""
    return build_probe()


#: Every kind of twin, as --fcsl-twin names them: tests of the fixture `open_twin` run on each.
TWINS = ["native", "process", "python"]


@pytest.fixture(params=TWINS)
def open_twin(request: pytest.FixtureRequest) -> Iterator[Callable[[Path], Twin]]:
    """Opens a machine JSON as a twin that is closed when the test ends."""
    opened: list[Twin] = []

    def open_one(config: Path) -> Twin:
        opened.append(twin_class(request.param).from_config(config))
        return opened[-1]

    yield open_one
    for twin in opened:
        twin.close()


@pytest.fixture(scope="session")
def craft(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The machine JSON of twin_craft.py."""
    folder = tmp_path_factory.mktemp("craft")
    (folder / "sensors.py").write_text(SENSORS)
    (folder / "watch.py").write_text(WATCH)
    (folder / "craft.json").write_text(json.dumps(CONFIG))
    return folder / "craft.json"


@pytest.fixture
def twin(open_twin: Callable[[Path], Twin], craft: Path) -> Twin:
    """Of `craft`, of each kind."""
    return open_twin(craft)
