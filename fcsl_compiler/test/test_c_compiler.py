# SPDX-License-Identifier: Apache-2.0
"""Which C compiler is taken, and what is said where there is none. `make verify` flies with zig."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.toolchain import CXX, C, ToolchainError, _query, _version, include_dirs, toolchain


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of PATH, which is empty; nothing else says what the compiler is. Versions are asked for anew."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    for name in ("CC", "CXX"):
        monkeypatch.delenv(name, raising=False)
    _query.cache_clear()
    _version.cache_clear()
    yield folder
    _query.cache_clear()
    _version.cache_clear()


@pytest.fixture
def zig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The Python package ziglang, whose compiler says how it was called."""
    folder = tmp_path / "packages/ziglang"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    program(folder / "zig", 'echo "zig $*"')
    monkeypatch.syspath_prepend(folder.parent)
    return folder / "zig"


def program(path: Path, line: str) -> None:
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


def test_zig_where_no_other_compiler_is(tools: Path, zig: Path) -> None:
    assert C.compiler()[:2] == [str(zig), "cc"] and CXX.compiler()[:2] == [str(zig), "c++"]
    # No hash of a build depends on where zig lies; all depend on the processor that it compiles for.
    assert str(zig.parent) not in toolchain() and "-mcpu=baseline" in toolchain()


def test_the_computers_own_compiler_comes_first(tools: Path, zig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tools / "cc", "echo gcc 12")
    assert C.compiler() == ["cc"] and toolchain().startswith("gcc 12 ")
    monkeypatch.setenv("CC", "clang -m32")
    assert C.compiler() == ["clang", "-m32"]


def test_no_compiler(tools: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcsl_compiler.driver.toolchain.find_spec", lambda name: None)
    with pytest.raises(ToolchainError) as error:
        toolchain()
    fix = "install gcc or the Python package ziglang (python3 -m pip install ziglang), or set CC"
    assert str(error.value) == f"no C compiler: `cc` does not run; {fix}"


def test_a_folder_with_a_comma_and_a_blank(tmp_path: Path) -> None:
    """`-Wl,` would split an option for the linker there."""
    folder = tmp_path / "out, of"
    folder.mkdir()
    config = Path(__file__).resolve().parents[2] / "examples/minimal/minimal.json"
    [made] = build_library([config], folder / "libminimal.so")
    assert (folder / "libminimal.so").is_file() and made.checked.name == "minimal"


@pytest.mark.parametrize("option", ["-ffast-math", "-Ofast", "-freciprocal-math", "-mfpmath=387"])
def test_options_that_change_results(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"cc {option}")
    with pytest.raises(ToolchainError, match=f"CC has {option}, which changes results"):
        toolchain()


@pytest.mark.parametrize("option", ["-ffast-math", "-ffinite-math-only", "-Ofast"])
def test_a_source_refuses_them_wherever_it_is_compiled(option: str, tmp_path: Path) -> None:
    (tmp_path / "m.c").write_text("#include <fcsl/fcsl_exact_math.h>\nint x;\n")
    line = ["cc", "-O3", option, f"-I{include_dirs()[0]}", "-c", str(tmp_path / "m.c"), "-o", str(tmp_path / "m.o")]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "change results" in done.stderr
    line.remove(option)
    subprocess.run(line, check=True)
