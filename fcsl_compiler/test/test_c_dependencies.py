# SPDX-License-Identifier: Apache-2.0
"""An edit of any file that C sources include is another build: of models and of externs, for every form of include."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from test_targets import HEADER, machine

from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.cache import build_machine, build_shared
from fcsl_compiler.driver.externs import build_externs
from fcsl_compiler.driver.record import SUFFIX
from fcsl_compiler.driver.toolchain import ToolchainError

#: For each form of include: what the source says, and the files besides it; `inc` is an include folder. The value that
#: the library returns comes from the last file, whose 1 becomes 2.
FORMS: dict[str, tuple[str, dict[str, str]]] = {
    "beside": ('#include "gain.h"', {"gain.h": "#define GAIN 1"}),
    "in a subfolder": ('#include "sub/gain.h"', {"sub/gain.h": "#define GAIN 1"}),
    "above": ('#include "../gain.h"', {"../gain.h": "#define GAIN 1"}),
    "nested": ('#include "a.h"', {"a.h": '#include "sub/b.h"', "sub/b.h": "#define GAIN 1"}),
    "include folder": ("#include <pkg/gain.h>", {"inc/pkg/gain.h": "#define GAIN 1"}),
    "include folder, quoted": ('#include "pkg/gain.h"', {"inc/pkg/gain.h": "#define GAIN 1"}),
    ".inc": ('static const int table =\n#include "gain.inc"\n;\n#define GAIN table', {"gain.inc": "1"}),
    "macro": ('#define FILE_NAME "gain.h"\n#include FILE_NAME', {"gain.h": "#define GAIN 1"}),
    "a C file": ('#include "table.c"\n#define GAIN table', {"table.c": "static const int table = 1;"}),
    "a name with blanks": ('#include "a gain #$.h"', {"a gain #$.h": "#define GAIN 1"}),
}


def write(folder: Path, form: str) -> Path:
    """Writes the files of a form. Returns the one to edit."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "inc").mkdir(exist_ok=True)
    for name, text in FORMS[form][1].items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return folder / list(FORMS[form][1])[-1]


def edit(path: Path) -> None:
    path.write_text(path.read_text().replace("1", "2"))


def result(library: Path, function: str) -> float:
    """What a function of the library returns, in a process of its own."""
    call = f"import ctypes; f = ctypes.CDLL({str(library)!r}).{function}; f.restype = ctypes.c_double; "
    call += "print(f(ctypes.c_double(0), (ctypes.c_double * 3)()))"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=True)
    return float(done.stdout)


def model(folder: Path, head: str) -> Callable[[], Path]:
    """A model's C with these first lines. Returns what builds it."""
    folder.mkdir(parents=True, exist_ok=True)
    body = 'double gain(void);\n__attribute__((visibility("default"))) double gain(void) { return GAIN; }\n'
    (folder / "plant.c").write_text(f"{head}\n{body}")
    return lambda: build_shared([folder / "plant.c"], [folder / "inc"])


def extern(folder: Path, head: str) -> Path:
    """A machine whose extern's C has these first lines."""
    stub = f'#include "probe.h"\n#include "craft.h"\n{head}\n'
    stub += "double probe(double gain, const double *raw) { return gain + raw[0] + GAIN; }\n"
    return machine(folder, {"simulation": {"sources": ["c/stub.c"], "include": ["c/include", "c/inc"]}}, c_stub_c=stub)


@pytest.mark.parametrize("form", FORMS)
def test_a_model_is_built_again_after_an_edit_of_what_it_includes(tmp_path: Path, form: str) -> None:
    build = model(tmp_path / "m", FORMS[form][0])
    edited = write(tmp_path / "m", form)
    first = build()
    assert build() == first and result(first, "gain") == 1.0
    edit(edited)
    assert result(build(), "gain") == 2.0
    edited.write_text(edited.read_text().replace("2", "1"))
    assert build() == first


@pytest.mark.parametrize("form", FORMS)
def test_a_machine_is_built_again_after_an_edit_of_what_its_extern_includes(tmp_path: Path, form: str) -> None:
    edited = write(tmp_path / "c", form)
    config = extern(tmp_path, FORMS[form][0])
    first, alone = build_machine(config), build_externs(config)
    assert build_machine(config) == first and build_externs(config) == alone
    hashes = {build_hash(first.library)}
    edit(edited)
    second = build_machine(config)
    assert result(build_externs(config), "probe") == 2.0
    assert second.library != first.library and len(hashes | {build_hash(second.library)}) == 2
    assert second.source_hash == first.source_hash  # a record of one target replays on another


def build_hash(library: Path) -> str:
    script = "from fcsl_test_abi import Machine; import sys; from pathlib import Path; "
    script += "print(Machine(Path(sys.argv[1]), 'craft').d.build_hash.decode())"
    command = [sys.executable, "-c", script, str(library)]
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": path})
    return done.stdout


@pytest.mark.parametrize("kind", ["model", "extern"])
def test_a_header_that_appears_earlier_in_the_search_counts(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / ("m" if kind == "model" else "c")
    write(folder, "include folder, quoted")
    build = _builder(tmp_path, kind, '#include "pkg/gain.h"')
    assert _gain(build()) == 1.0
    (folder / "pkg").mkdir()
    (folder / "pkg/gain.h").write_text("#define GAIN 3\n")
    assert _gain(build()) == 3.0


@pytest.mark.parametrize("kind", ["model", "extern"])
def test_a_file_that_is_only_asked_for_counts(tmp_path: Path, kind: str) -> None:
    build = _builder(tmp_path, kind, '#if __has_include("tuned.h")\n#define GAIN 4\n#else\n#define GAIN 1\n#endif')
    assert _gain(build()) == 1.0
    (tmp_path / ("m" if kind == "model" else "c") / "tuned.h").touch()
    assert _gain(build()) == 4.0


@pytest.mark.parametrize("kind", ["model", "extern"])
def test_a_header_that_vanishes_is_the_compilers_error(tmp_path: Path, kind: str) -> None:
    edited = write(tmp_path / ("m" if kind == "model" else "c"), "nested")
    build = _builder(tmp_path, kind, '#include "a.h"')
    first = build()
    edited.unlink()
    for _ in range(2):
        with pytest.raises(ToolchainError, match=r"sub/b\.h: No such file"):
            build()
    edited.write_text("#define GAIN 1\n")
    assert build() == first


def test_what_cannot_be_preprocessed_says_why(tmp_path: Path) -> None:
    build = _builder(tmp_path, "extern", "#error only for the board")
    with pytest.raises(ToolchainError, match="only for the board(?s:.*)Target `simulation` of .*craft.json cannot be"):
        build()
    with pytest.raises(ToolchainError, match="only for the board"):
        _builder(tmp_path, "model", "#error only for the board")()


def test_a_header_that_only_the_machine_includes_counts(tmp_path: Path) -> None:
    """The generated C includes it; the source of the extern does not."""
    stub = "double probe(double gain, const double *raw);\n"
    stub += "double probe(double gain, const double *raw) { return gain + raw[0]; }\n"
    config = machine(tmp_path, c_stub_c=stub)
    first = build_machine(config)
    (tmp_path / "c/include/probe.h").write_text(HEADER.replace("double probe", "#define UNUSED\ndouble probe"))
    assert build_machine(config).library != first.library


def test_parallel_builds_of_an_edited_header_all_get_the_new_one(tmp_path: Path) -> None:
    edited = write(tmp_path / "m", "nested")
    build = model(tmp_path / "m", FORMS["nested"][0])
    old = build()
    edit(edited)
    script = "import sys, pathlib; from fcsl_compiler.driver.cache import build_shared; "
    script += "print(build_shared([pathlib.Path(sys.argv[1])], [pathlib.Path(sys.argv[2])]))"
    command = [sys.executable, "-c", script, str(tmp_path / "m/plant.c"), str(tmp_path / "m/inc")]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    found = {process.communicate(timeout=120)[0].strip() for process in started}
    assert len(found) == 1 and found != {str(old)} and result(Path(found.pop()), "gain") == 2.0


def test_an_unchanged_machine_with_externs_is_loaded_without_the_compiler(tmp_path: Path) -> None:
    config = machine(tmp_path)
    library = build_machine(config).library
    script = "import sys, pathlib; from fcsl_compiler.driver.cache import build_machine; "
    script += "print(build_machine(pathlib.Path(sys.argv[1])).library); "
    script += "print({n.split('.')[1] for n in sys.modules if n.startswith('fcsl_compiler.')} & "
    script += "{'check', 'config', 'lower', 'emit'})"
    done = subprocess.run([sys.executable, "-c", script, str(config)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{library}\nset()\n"


def test_the_record_and_the_depfile_list_what_externs_include(tmp_path: Path) -> None:
    edited = write(tmp_path / "c", ".inc")
    config = extern(tmp_path, FORMS[".inc"][0])
    depfile = tmp_path / "craft.d"
    assert main(["build", str(config), "-o", str(tmp_path / "out"), "--depfile", str(depfile)]) == 0
    assert str(edited) in depfile.read_text().split()
    record = (tmp_path / f"out/libcraft.so{SUFFIX}").read_text()
    assert str(edited) in record and "/craft.h" not in record


def _builder(folder: Path, kind: str, head: str) -> Callable[[], Path]:
    if kind == "model":
        return model(folder / "m", head)
    config = extern(folder, head)
    (folder / "c/inc").mkdir(exist_ok=True)
    return lambda: build_externs(config) if build_machine(config) else Path()


def _gain(library: Path) -> float:
    return result(library, "gain" if library.name == "libplant.so" else "probe")
