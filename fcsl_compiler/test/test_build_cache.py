# SPDX-License-Identifier: Apache-2.0
"""The build cache with many processes: each build happens once and is complete, also if a builder is killed or nothing
can be written."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import resource
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

import fcsl_compiler
from fcsl_compiler.base.files import digest
from fcsl_compiler.driver.cache import build_shared

ALGORITHM = """
from gains import GAIN


class Law:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = GAIN * self.x
"""
GAINS = "GAIN = 2.0\n"

#: A C compiler that logs every run in $FCSL_TEST_LOG, and blocks in the run with number $FCSL_TEST_STOP. Two may run
#: at once.
WRAPPER = """\
#!/bin/sh
case "$*" in *--version*|*" -E "*) exec cc "$@";; esac
run=$(flock "$FCSL_TEST_LOG" sh -c 'echo "$1" >> "$0"; wc -l < "$0"' "$FCSL_TEST_LOG" "$*")
if [ "$run" = "$FCSL_TEST_STOP" ]; then echo $$ > "$FCSL_TEST_LOG.stopped"; kill -STOP $$; fi
exec cc "$@"
"""

BUILD = "import sys, pathlib; from fcsl_compiler.driver.cache import build_machine; "
BUILD += "print(build_machine(pathlib.Path(sys.argv[1])).library)"
#: Folders and modules of the compiler that a process has imported, and `_hashlib`, if it has, which loads OpenSSL.
IMPORTED = BUILD + (
    "; print(*sorted({name.removeprefix('fcsl_compiler.') for name in sys.modules "
    "if name.startswith(('fcsl_compiler.', '_hashlib'))}))"
)


class Place:
    """A machine, a separate cache, and a C compiler that counts its runs."""

    def __init__(self, folder: Path, compiler: Path):
        self.cache, self.log, self.config = folder / "cache", folder / "log", folder / "craft.json"
        self.compiler = compiler
        (folder / "law.py").write_text(ALGORITHM)
        (folder / "gains.py").write_text(GAINS)
        said = {
            "tick_hz": 10,
            "initial_state": "RUN",
            "algorithms": {"Law": {"source": "law.py"}},
            "instances": {"a": {"algorithm": "Law"}},
            "states": {"RUN": {"schedule": {"a": 10}}},
        }
        self.config.write_text(json.dumps(said))

    def start(self, stop: int = 0, before: Sequence[str] = (), **options: object) -> subprocess.Popen[str]:
        given = {
            "CC": str(self.compiler),
            "FCSL_CACHE_DIR": str(self.cache),
            "FCSL_TEST_LOG": str(self.log),
            "FCSL_TEST_STOP": str(stop),
        }
        return subprocess.Popen(  # -B: no compiled import is cut short for later processes when files may not grow
            [*before, sys.executable, "-B", "-c", BUILD, str(self.config)],
            env={**os.environ, **given},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,  # type: ignore[call-overload]
        )

    def runs(self) -> int:
        """Runs of the C compiler, including one that is blocked."""
        return len(self.log.read_text().splitlines()) if self.log.exists() else 0

    def hidden(self) -> list[Path]:
        """Incomplete files and folders."""
        return [p for p in self.cache.rglob(".*")]


@pytest.fixture(scope="module")
def compiler(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("compiler") / "wrapped"
    path.write_text(WRAPPER)
    path.chmod(0o755)
    return path


@pytest.fixture
def place(tmp_path: Path, compiler: Path) -> Place:
    return Place(tmp_path, compiler)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory, compiler: Path) -> Path:
    """A cache with the library of the machine."""
    first = Place(tmp_path_factory.mktemp("filled"), compiler)
    built(first.start())
    return first.cache


@pytest.fixture
def library(place: Place, filled: Path) -> Path:
    """The library of the machine, in the cache of `place`, as if it had been built there."""
    shutil.copytree(filled, place.cache)
    return next(place.cache.glob("machines/*/libcraft.so"))


def built(process: subprocess.Popen[str]) -> Path:
    out, error = process.communicate(timeout=120)
    assert process.returncode == 0, error
    library = Path(out.strip())
    ctypes.CDLL(str(library)).fcsl_machines  # noqa: B018  it is whole
    return library


def refused(process: subprocess.Popen[str]) -> str:
    _, error = process.communicate(timeout=120)
    assert process.returncode == 1 and "ToolchainError" in error, error
    return error


def test_eight_processes_at_a_cold_cache_build_once(place: Place) -> None:
    processes = [place.start() for _ in range(8)]
    assert len({built(p) for p in processes}) == 1
    once = place.runs()
    assert once >= 2  # compiled and linked
    assert not place.hidden()
    built(place.start())
    assert place.runs() == once
    next(place.cache.glob("machines/*/built.json")).unlink()  # the control: a build would be detected
    built(place.start())
    assert place.runs() == 2 * once


def test_an_unchanged_machine_is_loaded_without_the_compiler(place: Place) -> None:
    def imported() -> set[str]:
        command = [sys.executable, "-c", IMPORTED, str(place.config)]
        environment = {**os.environ, "FCSL_CACHE_DIR": str(place.cache)}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
        return set(done.stdout.splitlines()[1].split())

    compiler = {"check", "config", "emit", "lower", "printers", "base.diagnostics", "parse.machine_files"}
    assert compiler <= imported(), "the first process compiles"
    assert not (compiler | {"_hashlib"}) & imported()


def _start_to(place: Place, run: int) -> tuple[subprocess.Popen[str], int]:
    """A builder that has reached this run of the C compiler, and the process of the run."""
    stopped = place.log.with_name("log.stopped")
    os.mkfifo(stopped)
    reader = os.open(stopped, os.O_RDONLY | os.O_NONBLOCK)
    try:
        process = place.start(run)
        while process.poll() is None:
            if select.select([reader], [], [], 0.5)[0]:
                return process, int(os.read(reader, 64))
        pytest.fail(f"the build ended before: {process.communicate()}")
    finally:
        os.close(reader)
        stopped.unlink()


def _kill(process: subprocess.Popen[str], compiler: int) -> None:
    process.kill()
    os.kill(compiler, signal.SIGKILL)
    process.communicate()


def test_a_killed_builder_leaves_nothing_that_blocks_or_harms(place: Place) -> None:
    whole = built(place.start()).read_bytes()
    last = place.runs()
    for run in range(1, last + 1):
        shutil.rmtree(place.cache)
        place.log.unlink()
        _kill(*_start_to(place, run))
        assert not list(place.cache.glob("machines/*/built.json"))
        assert place.hidden()  # the control: incomplete files were left
        assert built(place.start()).read_bytes() == whole
        assert not place.hidden()


def test_who_waits_for_a_builder_that_is_killed_builds(place: Place) -> None:
    first, compiler = _start_to(place, 1)
    others = [place.start() for _ in range(3)]
    _kill(first, compiler)
    assert len({built(p) for p in others}) == 1


#: What a crash of the system, or a disk, does to a file.
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut short": lambda whole: whole[:1000],
    "zeros": lambda whole: bytes(len(whole)),
    "zeros in its code": lambda whole: whole[:4096] + bytes(len(whole[4096:])),
    "one bit": lambda whole: whole[:-10] + bytes([whole[-10] ^ 1]) + whole[-9:],
    "empty": lambda whole: b"",
    "nested deeply": lambda whole: b"[" * 100_000,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
@pytest.mark.parametrize("file", ["libcraft.so", "built.json"])
def test_a_damaged_entry_is_built_again(
    place: Place, library: Path, file: str, damage: Callable[[bytes], bytes]
) -> None:
    whole = library.read_bytes()
    damaged = library.with_name(file)
    content = damaged.read_bytes()
    damaged.write_bytes(damage(content))
    process = place.start()
    out, error = process.communicate(timeout=120)
    assert (process.returncode, error) == (0, "") and library.read_bytes() == whole
    once = place.runs()
    assert bool(once) == (damage(content) != content)  # built.json is shorter than what "cut short" leaves
    assert built(place.start()) == Path(out.strip()) == library and place.runs() == once


@pytest.mark.parametrize("file", ["libcraft.so", "built.json"])
def test_a_pipe_in_the_place_of_a_file_is_replaced(place: Place, library: Path, file: str) -> None:
    """And nobody waits for who writes into it."""
    whole = library.read_bytes()
    library.with_name(file).unlink()
    os.mkfifo(library.with_name(file))
    assert built(place.start()) == library and library.read_bytes() == whole
    assert library.with_name(file).is_file()


def test_a_pipe_in_the_place_of_the_lock_is_named(place: Place, library: Path) -> None:
    (library.with_name("built.json")).unlink()
    library.with_name("lock").unlink()
    os.mkfifo(library.with_name("lock"))
    assert str(library.with_name("lock")) in refused(place.start())


def test_a_damaged_model_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fcsl_compiler.driver.cache import build_shared

    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "plant.c").write_text("int plant = 1;\n")
    library = build_shared([tmp_path / "plant.c"], [])
    whole = library.read_bytes()
    library.write_bytes(bytes(len(whole)))
    assert build_shared([tmp_path / "plant.c"], []) == library and library.read_bytes() == whole


def test_all_is_on_the_disk_before_an_entry_appears(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fcsl_compiler.driver.cache import build_shared

    events: list[str] = []
    sync, replace = os.fsync, Path.replace

    def fsync(handle: int) -> None:
        events.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        sync(handle)

    def rename(path: Path, target: Path) -> Path:
        events.append(f"rename to {target.name}")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", rename)
    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "plant.c").write_text("int plant = 1;\n")
    folder = build_shared([tmp_path / "plant.c"], []).parent.name
    published = events.index("rename to built.json")
    assert {"libplant.so", folder, ".built.json-"} <= set(events[:published]) and folder in events[published:]


def test_a_source_that_changes_during_its_build_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fcsl_compiler.driver import cache
    from fcsl_compiler.driver.toolchain import ToolchainError

    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))
    source = tmp_path / "plant.c"
    link, edits = cache.link_shared, ["int plant = 2;\n"]

    def slow(*arguments: Any, **options: Any) -> None:
        link(*arguments, **options)
        if edits:
            source.write_text(edits.pop())

    monkeypatch.setattr(cache, "link_shared", slow)
    source.write_text("int plant = 1;\n")
    library = cache.build_shared([source], [])
    assert len(list((tmp_path / "cache/shared").glob("*/built.json"))) == 1
    assert cache.build_shared([source], []) == library
    edits += [f"int plant = {n};\n" for n in range(3, 9)]
    source.write_text("int other = 1;\n")
    with pytest.raises(ToolchainError, match="plant.c: its sources change while it is built"):
        cache.build_shared([source], [])


def test_folders_of_the_cache_are_closed_to_others(place: Place) -> None:
    before = os.umask(0)
    try:
        built(place.start())
    finally:
        os.umask(before)
    folders = [place.cache, *(p for p in place.cache.rglob("*") if p.is_dir())]
    assert len(folders) == 3 and {folder.stat().st_mode & 0o777 for folder in folders} == {0o700}


@pytest.mark.parametrize("depth", [0, 1, 2])
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_cache_in_which_others_may_write_is_refused(place: Place, library: Path, depth: int, mode: int) -> None:
    folder = [place.cache, library.parents[1], library.parent][depth]
    folder.chmod(mode)
    error = refused(place.start())
    assert f"{folder}: not used as a cache of builds, because others may write in it (mode 0{mode:o})" in error
    assert f"run `chmod 700 {folder}`, or set FCSL_CACHE_DIR to a folder of your own" in error
    folder.chmod(0o700)
    assert built(place.start()) == library and not place.runs()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_cache_of_somebody_else_is_refused(place: Place, library: Path) -> None:
    os.chown(place.cache, 12345, -1)
    error = refused(place.start())
    assert (
        f"{place.cache}: not used as a cache of builds, because it belongs to user 12345, and you are user 0" in error
    )
    assert "set FCSL_CACHE_DIR to a folder of your own" in error


#: Permissions have no effect for root.
BOUND = ["setpriv", "--bounding-set", "-dac_override", "--inh-caps", "-dac_override"] if os.geteuid() == 0 else []


def test_a_cache_that_is_read_only_is_read(place: Place, library: Path) -> None:
    folders = [place.cache, *(p for p in place.cache.rglob("*") if p.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    try:
        assert built(place.start(before=BOUND)) == library
        place.config.write_text(place.config.read_text().replace('"tick_hz": 10', '"tick_hz": 20'))
        said = refused(place.start(before=BOUND))
        assert "Permission denied" in said and f"the cache of builds is {place.cache}: set FCSL_CACHE_DIR" in said
    finally:
        for folder in folders:
            folder.chmod(0o755)


@pytest.mark.parametrize("below", ["cache", "folder/cache"])
def test_a_cache_that_cannot_be_made_is_named(place: Place, below: str) -> None:
    closed = place.config.parent / "closed"
    closed.mkdir()
    place.cache = closed / below
    closed.chmod(0o555)
    try:
        said = refused(place.start(before=BOUND))
        assert "Permission denied" in said and f"the cache of builds is {place.cache}: set FCSL_CACHE_DIR" in said
    finally:
        closed.chmod(0o755)


def _limit(size: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.mark.parametrize("size", [0, 2000, 8000])
def test_a_full_disk_is_an_error_and_leaves_nothing_wrong(place: Place, size: int) -> None:
    """No file may exceed the limit. Writes then fail at the lock, at the C files, or in the compiler."""
    refused(place.start(preexec_fn=_limit(size)))
    assert not list(place.cache.glob("machines/*/built.json"))
    built(place.start())


def test_digests_are_of_sha_256() -> None:
    framed = b"\2\0\0\0\0\0\0\0" + "é".encode() + b"\xe8\3\0\0\0\0\0\0" + b"x" * 1000
    assert digest("é", b"x" * 1000) == hashlib.sha256(framed).hexdigest()


def test_another_compiler_builds_anew(place: Place, tmp_path: Path) -> None:
    package = tmp_path / "python/fcsl_compiler"
    shutil.copytree(Path(fcsl_compiler.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    before = ["env", "PYTHONSAFEPATH=1", f"PYTHONPATH={package.parent}:{os.environ['PYTHONPATH']}"]

    def runs_of_a_build() -> int:
        earlier = place.runs()
        built(place.start(before=before))
        return place.runs() - earlier

    assert [runs_of_a_build() > 0 for _ in range(2)] == [True, False]
    changed = package / "emit/tick.py"
    changed.write_text(changed.read_text() + "\n")
    assert [runs_of_a_build() > 0 for _ in range(2)] == [True, False]


def test_a_file_that_is_imported_is_part_of_the_build(place: Place) -> None:
    """A change of a constant in it gives another library with another hash, and the earlier library is older than its
    sources."""
    from fcsl_compiler.driver.library import build_library
    from fcsl_compiler.driver.record import SUFFIX, StaleBuild, check_record, write_record

    def source_hash(built_library: Path) -> str:
        return str(json.loads(built_library.with_name("built.json").read_text())["facts"]["source_hash"])

    first = built(place.start())
    library = place.config.parent / "out" / "libcraft.so"
    compilations = build_library([place.config], library)
    write_record(Path(f"{library}{SUFFIX}"), compilations, "fcsl build")
    check_record(library, "craft", compilations[0].build_hash)
    gains = place.config.parent / "gains.py"
    gains.write_text("GAIN = 3.0\n")
    with pytest.raises(StaleBuild, match="gains.py has changed"):
        check_record(library, "craft", compilations[0].build_hash)
    second = built(place.start())
    assert second != first and source_hash(second) != source_hash(first)
    gains.write_text(GAINS)
    assert built(place.start()) == first


def test_a_model_is_built_again_when_a_header_has_changed(tmp_path: Path) -> None:
    """A newer FCSL brings newer headers: a model that was compiled with the old ones would be of another ABI."""
    include, source = tmp_path / "include", tmp_path / "model.c"
    (include / "fcsl").mkdir(parents=True)
    visible = '__attribute__((visibility("default")))'
    source.write_text(f'#include "fcsl/fcsl_version_of_test.h"\n{visible} int version(void) {{ return VERSION; }}\n')
    found = []
    for version in (1, 1, 2):
        (include / "fcsl" / "fcsl_version_of_test.h").write_text(f"#define VERSION {version}\n")
        library = build_shared([source], [include])
        found.append((library, ctypes.CDLL(str(library)).version()))
    assert found[0] == found[1] and [version for _, version in found] == [1, 1, 2] and found[2][0] != found[0][0]
