# SPDX-License-Identifier: Apache-2.0
"""Machines to test with: `probe` is test/machines/probe.json."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from twin_craft import CONFIG, SENSORS, WATCH

from fcsl_compiler.api.build import build_machine
from simclient import Twin
from simclient.twin.pytest_twins import twin_class

ROOT = Path(__file__).resolve().parents[3]
PROBE = ROOT / "fcsl_runtime/simclient/test/machines/probe.json"
CFLAGS = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared"]


@pytest.fixture(scope="session")
def build_guarded(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Builds the machine of tests of fcsl-guard with the given macros, once per set of them."""
    built: dict[tuple[str, ...], Path] = {}

    def build(*macros: str) -> Path:
        if macros not in built:
            library = tmp_path_factory.mktemp("guarded") / "libguarded.so"
            source = ROOT / "fcsl_runtime/simclient/test/machines/guarded.c"
            include = ROOT / "fcsl_compiler/include"
            flags = [*CFLAGS, f"-I{include}", *(f"-D{macro}" for macro in macros)]
            subprocess.run(["cc", *flags, str(source), "-o", str(library)], check=True)
            built[macros] = library
        return built[macros]

    return build


@pytest.fixture(scope="session")
def probe() -> Path:
    """The probe machine's library."""
    return build_machine(PROBE).library


def edited_probe(folder: Path, file: str, old: str, new: str) -> Path:
    """The library of a probe with another text in one of its files, which are put into the folder."""
    shutil.copytree(PROBE.parent, folder, dirs_exist_ok=True)
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    return build_machine(folder / PROBE.name).library


@pytest.fixture(scope="session")
def renamed_probe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library of a probe of other sources with the same layout."""
    return edited_probe(
        tmp_path_factory.mktemp("renamed"), "probe.json", '"description": "', '"description": "Another: '
    )


@pytest.fixture(scope="session")
def grown_probe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library of a probe with another layout: `echo.outputs.extra` comes behind."""
    folder = tmp_path_factory.mktemp("grown")
    return edited_probe(folder, "algorithms/echo.py", '"count": "u64", ', '"count": "u64", "extra": "f64", ')


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
