# SPDX-License-Identifier: Apache-2.0
"""The runtime of the environment: found, missing, incomplete, or no runtime at all."""

from __future__ import annotations

import re
from collections.abc import Callable
from ctypes import c_int, c_uint64
from pathlib import Path

import pytest

from simclient import TwinError
from simclient.cli import missing_package
from simclient.library import RUNTIME_LIBRARY, RUNTIME_PACKAGE, bind_runtime, runtime_library, runtime_program

WORKSPACE = Path(__file__).resolve().parents[3]
FINDERS: dict[str, Callable[[], Path]] = {
    f"lib/{RUNTIME_LIBRARY}": runtime_library,
    "bin/fcsl-fc": lambda: runtime_program("fcsl-fc"),
}


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment with a runtime of which nothing is there but its entry in the index."""
    entry = tmp_path / "install/share/ament_index/resource_index/packages" / RUNTIME_PACKAGE
    entry.parent.mkdir(parents=True)
    entry.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'none'}:{tmp_path / 'install'}")
    return tmp_path / "install"


@pytest.mark.parametrize("file", FINDERS)
def test_what_is_installed_is_found(file: str, prefix: Path) -> None:
    (prefix / file).parent.mkdir()
    (prefix / file).touch()
    assert FINDERS[file]() == prefix / file


@pytest.mark.parametrize("file", FINDERS)
def test_what_is_incomplete_is_said(file: str, prefix: Path) -> None:
    (prefix / file).mkdir(parents=True)
    with pytest.raises(TwinError, match=rf"{file} is missing: package `{RUNTIME_PACKAGE}` is installed incompletely"):
        FINDERS[file]()


@pytest.mark.parametrize("file", FINDERS)
def test_without_the_package_the_remedy_is_said(file: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(TwinError, match=f"package `{RUNTIME_PACKAGE}` is not installed in this environment; source"):
        FINDERS[file]()


def test_another_library_is_no_runtime(tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("no library")
    with pytest.raises(TwinError, match="text.so cannot be used as the FCSL runtime: "):
        bind_runtime(tmp_path / "text.so", {})
    with pytest.raises(TwinError, match="cannot be used as the FCSL runtime: .*fcsl_no_function"):
        bind_runtime(runtime_library(), {"fcsl_no_function": (c_int, [])})


def test_each_function_that_is_named_has_a_prototype() -> None:
    """In simclient, the simulator and the nodes. `.fcsl_x` is a use but for pytest's marks, `"fcsl_x": (` an entry of a table."""
    used, tables = set[str](), set[str]()
    for folder in ("fcsl_runtime/simclient/simclient", "fcsl_sim/fcsl_sim", "fcsl_bridge/fcsl_bridge"):
        for file in (WORKSPACE / folder).rglob("*.py"):
            text = file.read_text()
            used |= set(re.findall(r"(?<!mark)\.(fcsl_\w+)", text))
            tables |= set(re.findall(r'"(fcsl_\w+)": \(', text))
    assert len(used) > 50 and used <= tables, used - tables


def test_a_function_without_a_prototype_cannot_be_called() -> None:
    library = bind_runtime(runtime_library(), {"fcsl_run_ieee_mode": (c_uint64, [])})
    assert library.fcsl_run_ieee_mode() != 0
    with pytest.raises(AttributeError, match="fcsl_run_tick has no prototype"):
        library.fcsl_run_tick  # noqa: B018


@pytest.mark.parametrize(
    ("module", "package"), [("zenoh.handlers", "eclipse-zenoh"), ("rerun", "rerun-sdk"), ("scipy.optimize", "scipy")]
)
def test_a_missing_package_is_called_as_pip_calls_it(module: str, package: str) -> None:
    error = ModuleNotFoundError(f"No module named '{module}'", name=module)
    assert missing_package(error).startswith(
        f"it needs the Python package {package}: python3 -m pip install {package};"
    )
    with pytest.raises(ModuleNotFoundError):
        missing_package(ModuleNotFoundError("No module named 'simclient.nope'", name="simclient.nope"))
