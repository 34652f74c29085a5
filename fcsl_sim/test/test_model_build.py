# SPDX-License-Identifier: Apache-2.0
"""The library of a model comes from the cache without a compiler's run, and is built anew when anything it includes has changed."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_sim.model_instance import ModelInstance
from fcsl_sim.models import ModelTable
from fcsl_sim.plugins import compile_model

MODEL = """
#include "fcsl/fcsl_model.h"
INCLUDE

typedef struct {
    struct { double y; } outputs;
} constant_t;

static void output(void *self, double t, const double *x)
{
    (void)t, (void)x;
    ((constant_t *)self)->outputs.y = VALUE;
}

static const fcsl_field_t fields[] = {FCSL_MODEL_SCALAR(constant_t, FCSL_ROLE_OUTPUT, outputs.y, "", "")};
static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "constant", .doc = "", .fields = fields, .field_count = 1,
    .size = sizeof(constant_t), .align = _Alignof(constant_t), .sampled_offset = FCSL_NO_OFFSET, .output = output,
};
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""
Popen = subprocess.Popen


class Runs:
    """How many processes were started."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch):
        self.count = 0
        monkeypatch.setattr(subprocess, "Popen", self._start)

    def _start(self, *arguments: Any, **keys: Any) -> subprocess.Popen[bytes]:
        self.count += 1
        return Popen(*arguments, **keys)

    def of(self, action: Callable[[], object]) -> int:
        before = self.count
        action()
        return self.count - before


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model whose output is VALUE of value.h; the cache is empty."""
    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "value.h").write_text('#include "deeper.h"\n')
    (tmp_path / "deeper.h").write_text("#define VALUE 1.0\n")
    (tmp_path / "constant.c").write_text(MODEL.replace("INCLUDE", '#include "value.h"'))
    return tmp_path / "constant.c"


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Runs:
    return Runs(monkeypatch)


def value(table: ModelTable) -> float:
    model = ModelInstance(table.library, table.name)
    model.output()
    found = model.get("outputs.y")
    assert isinstance(found, float)
    return found


def replace(path: Path, text: str) -> None:
    """The content alone: size and time of change stay, as far as a program can hide them."""
    before = path.stat()
    path.write_text(text)
    assert path.stat().st_size == before.st_size
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_no_compiler_runs_for_a_model_that_has_not_changed(source: Path, runs: Runs) -> None:
    assert runs.of(lambda: compile_model(source)) > 0
    assert runs.of(lambda: compile_model(source)) == 0
    assert value(compile_model(source)) == 1.0


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("deeper.h", "1.0", "2.0"),
        ("value.h", "deeper", "second"),
        ("constant.c", "= VALUE", "= 2.000"),
    ],
)
def test_a_change_is_noticed_in_whatever_is_read(source: Path, name: str, old: str, new: str) -> None:
    """By its content: the time of a file says nothing."""
    source.with_name("second.h").write_text("#define VALUE 2.0\n")
    assert value(compile_model(source)) == 1.0
    file = source.with_name(name)
    replace(file, file.read_text().replace(old, new))
    assert value(compile_model(source)) == 2.0


def test_a_header_that_appears_before_another_one_is_noticed(source: Path) -> None:
    """In a folder that is searched earlier than that in which it was found."""
    source.write_text(MODEL.replace("INCLUDE", "#ifndef VALUE\n#define VALUE 1.0\n#endif"))
    assert value(compile_model(source)) == 1.0
    (source.parent / "fcsl").mkdir()
    (source.parent / "fcsl/fcsl_model.h").write_text("#define VALUE 2.0\n#include_next <fcsl/fcsl_model.h>\n")
    assert value(compile_model(source)) == 2.0


@pytest.mark.parametrize(
    "include",
    [
        '#define HEADER "value.h"\n#include HEADER',
        '#if __has_include("value.h")\n#include "value.h"\n#endif',
        '#include_next "value.h"',
        '#import "value.h"',
    ],
)
def test_where_text_does_not_say_what_is_read_the_compiler_does(source: Path, include: str, runs: Runs) -> None:
    source.write_text(MODEL.replace("INCLUDE", include))
    assert value(compile_model(source)) == 1.0
    assert runs.of(lambda: compile_model(source)) > 0
    replace(source.with_name("deeper.h"), "#define VALUE 2.0\n")
    assert value(compile_model(source)) == 2.0


@pytest.mark.parametrize(
    "include",
    [
        '#  include /* a comment */ "value.h" // and another',
        '/* a comment\n ends here */ #include "value.h"',
        '#inc\\\nlude "val\\\nue.h"',
        '%:include "value.h"',
        '#if 1 // below a condition\n#include "value.h"\n#else\n#include "none.h"\n#endif',
    ],
)
def test_every_form_of_a_directive_counts(source: Path, include: str, runs: Runs) -> None:
    source.write_text(MODEL.replace("INCLUDE", include))
    assert value(compile_model(source)) == 1.0
    assert runs.of(lambda: compile_model(source)) == 0
    replace(source.with_name("deeper.h"), "#define VALUE 2.0\n")
    assert value(compile_model(source)) == 2.0


def test_with_variables_that_add_folders_the_compiler_is_asked(
    source: Path, monkeypatch: pytest.MonkeyPatch, runs: Runs
) -> None:
    compile_model(source)
    monkeypatch.setenv("CPATH", str(source.parent))
    assert runs.of(lambda: compile_model(source)) > 0
