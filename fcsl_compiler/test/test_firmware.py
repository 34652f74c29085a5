# SPDX-License-Identifier: Apache-2.0
"""`fcsl build --processor`: the static library, what it says of itself, and what it refuses. This computer's gcc stands for the compiler of
a processor; a Cortex-M7 flies in `make verify`."""

from __future__ import annotations

import io
import json
import platform
import re
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.base.usage_error import UsageError
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.elf import read_object
from fcsl_compiler.driver.toolchain import ToolchainError
from fcsl_compiler.firmware import processors
from fcsl_compiler.firmware.code import Code

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64" or shutil.which("gcc") is None, reason="gcc of x86-64 stands for that of a processor"
)
ROOT = Path(__file__).resolve().parents[2]
LANDER = ROOT / "examples/lander/fc/lander_control.json"
GUARD = ROOT / "examples/thermal_guard/thermal_guard.json"
PAINTED = ROOT / "scripts/verify/binary"
#: A project: it calls the machine by its descriptor, and measures the stack of a step.
PROJECT = r"""
#include <fcsl/fcsl_machine.h>
#include <stdio.h>
#include "painted.h"
static _Alignas(16) uint8_t data[1 << 16];
int main(void)
{
    const fcsl_machine_t *d = fcsl_machines[0];
    const fcsl_host_t host = {0};
    size_t most = 0;
    uint64_t hash = 0;
    d->init(data);
    if (d->start(data) != 0) return 1;
    for (int tick = 0; tick < 300; tick++) {
        for (uint32_t i = 0; i < d->channel_count; i++) {
            const fcsl_channel_t *c = &d->channels[i];
            if (c->direction == FCSL_SENSOR) *(double *)(data + d->fields[c->field].offset) = 0.37 * tick + i;
        }
        painted_begin();
        painted_call((const void *)d->step, (uint64_t[4]){(uintptr_t)data, (uintptr_t)&host}, (double[3]){0});
        if (painted_used() > most) most = painted_used();
        for (uint32_t i = 0; i < d->size; i++) hash = (hash ^ data[i]) * 1099511628211u;
    }
    printf("%u %zu %llx\n", d->size, most, (unsigned long long)hash);
    return 0;
}
"""


def build(config: Path, folder: Path, processor: str = "gcc") -> dict[str, Any]:
    """The report of `--json`."""
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["build", str(config), "--processor", processor, "-o", str(folder), "--json"]) == 0
    report: dict[str, Any] = json.loads(printed.getvalue())["report"]
    return report


def run_project(folder: Path, name: str, arguments: Sequence[str]) -> list[str]:
    """Size, stack and hash that the project prints, linked with `arguments`."""
    source, program = folder / "project.c", folder / name
    source.write_text(PROJECT)
    includes = [f"-I{PAINTED}", f"-I{package_prefix('fcsl_compiler') / 'include'}"]
    line = ["gcc", "-std=gnu11", "-no-pie", *includes, source, PAINTED / "painted.c", *arguments, "-o", program]
    subprocess.run(line, check=True)
    return subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()


@pytest.fixture(scope="module")
def lander(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Folder and report."""
    folder = tmp_path_factory.mktemp("lander")
    return folder, build(LANDER, folder)


def test_a_project_links_it_and_computes_what_hosts_do(lander: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    folder, report = lander
    bytes_, stack, digest = run_project(folder, "static", [f"-L{folder}", "-llander_control", "-lm"])
    assert main(["build", str(LANDER), "-o", str(tmp_path / "host")]) == 0
    shared = [str(tmp_path / "host/liblander_control.so"), f"-Wl,-rpath,{tmp_path / 'host'}"]
    assert run_project(folder, "shared", shared)[2] == digest
    (machine,) = report["machines"]
    assert machine["struct_bytes"] == int(bytes_)
    assert int(stack) <= machine["stack_bytes"]["step"] < 4 * int(stack)


def test_a_level_of_optimisation_is_taken(lander: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    small = build(LANDER, tmp_path / "small", "gcc -Os")
    assert small["machines"][0]["functions"]["code"] < lander[1]["machines"][0]["functions"]["code"]


def test_what_it_needs_is_what_a_linker_misses(lander: tuple[Path, dict[str, Any]]) -> None:
    """Without any library; and nothing of it is in RAM."""
    folder, report = lander
    (folder / "user.c").write_text(
        "#include <fcsl/fcsl_monitor.h>\nconst void *const used[] = {fcsl_machines, fcsl_monitors};\n"
    )
    line = [
        "gcc",
        "-nostdlib",
        "-no-pie",
        "-Wl,-e,used",
        f"-I{folder}",
        folder / "user.c",
        folder / "liblander_control.a",
    ]
    done = subprocess.run([*line, "-o", folder / "user"], capture_output=True, text=True)
    assert set(re.findall(r"undefined reference to `(\w+)'", done.stderr)) == set(report["needs"]), done.stderr
    parts = [m[part] for m in report["machines"] for part in ("functions", "descriptor")] + [report["monitors"]]
    assert all(part["data"] == part["zeros"] == 0 for part in parts)


def test_its_sizes_are_those_of_a_linker(lander: tuple[Path, dict[str, Any]]) -> None:
    """Which leaves out what nobody refers to, and adds padding."""
    folder, report = lander
    flags = "-nostdlib -no-pie -Wl,--gc-sections -Wl,-u,fcsl_machines -Wl,-e,0 -Wl,--unresolved-symbols=ignore-all"
    subprocess.run(["gcc", *flags.split(), "liblander_control.a", "-o", "linked"], cwd=folder, check=True)
    rows = subprocess.run(["size", "linked"], cwd=folder, check=True, capture_output=True, text=True).stdout.split("\n")
    (machine,) = report["machines"]
    said = sum(machine[part][kind] for part in ("functions", "descriptor") for kind in ("code", "constants"))
    assert 0 <= int(rows[1].split()[0]) - said < said // 50


def test_only_the_functions_of_fcsl_math_that_are_called(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "class A:\n    inputs = {'x': 'f64'}\n    outputs = {'y': 'f64'}\n    def execute(self):\n        self.y = atan2(self.x, 2.0)\n"
    config = write_machine(
        tmp_path,
        "turn",
        {
            "tick_hz": 10,
            "initial_state": "S",
            "instances": {"a": {"algorithm": "A"}},
            "states": {"S": {"schedule": {"a": 10}}},
        },
        {"a": text},
    )
    build(config, tmp_path / "fused", "gcc -mfma -msse4.1")
    listed = subprocess.run(
        ["ar", "t", tmp_path / "fused/libturn.a"], check=True, capture_output=True, text=True
    ).stdout
    assert [name.partition("-")[0] for name in listed.split()] == ["turn", "fcsl_machines", "atan2"]
    assert main(["build", str(config), "--processor", "gcc", "-o", str(tmp_path / "plain")]) == 1
    said = capsys.readouterr().err
    assert "would call fma" in said and "one rounding" in said
    assert not (tmp_path / "plain").exists()


def test_externs_in_c_are_compiled_too(tmp_path: Path) -> None:
    report = build(GUARD, tmp_path)
    assert "read_cpu_temp" not in report["needs"]
    assert (
        "cpu_temp_stub-2.o"
        in subprocess.run(
            ["ar", "t", tmp_path / "libthermal_guard.a"], check=True, capture_output=True, text=True
        ).stdout
    )


def test_it_keeps_the_table_of_fields_of_instances_that_are_alike(tmp_path: Path) -> None:
    """Hosts make it when they open a machine; a project has no memory for it."""
    names = [f"count{n}" for n in range(80)]
    text = """class Count:
    outputs = {"runs": "i64"}

    def execute(self):
        self.runs += 1
"""
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "instances": {name: {"algorithm": "Count"} for name in names},
        "states": {"A": {"schedule": dict.fromkeys(names, 10)}},
    }
    many = write_machine(tmp_path, "many", config, {"count": text})
    build(many, tmp_path / "out")
    assert main(["build", str(many), "-o", str(tmp_path / "host")]) == 0
    assert ".folded = " not in (tmp_path / "out/many.c").read_text()
    assert ".folded = " in (tmp_path / "host/many.c").read_text()


@pytest.mark.parametrize(
    ("processor", "words"),
    [
        ("cortex-m99", ["cortex-m7", "cortex-m4", "gcc-arm-none-eabi"]),
        ("", ["names nothing"]),
        ("'gcc", ["quotation"]),
        ("gcc -ffast-math", ["-ffast-math", "changes results"]),
        ("gcc --no-such-option", ["failed", "--no-such-option"]),
    ],
)
def test_a_processor_that_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], processor: str, words: list[str]
) -> None:
    assert main(["build", str(LANDER), "--processor", processor, "-o", str(tmp_path / "out")]) in (1, 2)
    said = capsys.readouterr().err
    assert all(word in said for word in words), said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--report", "--c-only", "--sarif", "--backend nim", "--dump emit"])
def test_options_that_do_not_go_together(capsys: pytest.CaptureFixture[str], option: str) -> None:
    assert main(["build", str(LANDER), "--processor", "gcc", *option.split()]) == 2
    assert option.split()[0] in capsys.readouterr().err


def test_without_clang_the_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processors.shutil, "which", lambda _: None)
    with pytest.raises(ToolchainError, match="apt-get install clang-19"):
        processors.find_processor("cortex-m7")
    with pytest.raises(UsageError, match="neither a processor"):
        processors.find_processor("arm-none-eabi-gcc -mthumb")


def test_code_that_is_rarely_executed_belongs_to_its_function(tmp_path: Path) -> None:
    """gcc moves it to a section of its own, whose frame it does not report; a copy of a function has a number there alone."""
    source = tmp_path / "parts.c"
    source.write_text(
        "void rare(char *) __attribute__((cold));\nint deep(int);\n"
        "int f(int x) { if (x > 9) { char b[999]; rare(b); x = deep(b[x % 99]); } return x; }\nint g(int x) { return f(x) + 1; }\n"
    )
    subprocess.run(
        ["gcc", "-O2", "-ffunction-sections", "-fstack-usage", "-fno-pic", "-c", source, "-o", tmp_path / "parts.o"],
        check=True,
    )
    code = Code([tmp_path / "parts.o"])
    assert "f.cold" in read_object(tmp_path / "parts.o").functions
    found = code.stack("g", "g")
    assert found is not None and 999 + 256 < found < 2500
    assert code.missing(code.reached(["g"])) == {"rare", "deep"}


def test_a_frame_without_a_bound_has_none(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("void use(char *); void f(int n) { char b[n]; use(b); } void g(int n) { f(n); }")
    subprocess.run(
        [
            "gcc",
            "-O1",
            "-fno-inline",
            "-ffunction-sections",
            "-fstack-usage",
            "-c",
            tmp_path / "a.c",
            "-o",
            tmp_path / "a.o",
        ],
        check=True,
    )
    assert Code([tmp_path / "a.o"]).stack("g", "g") is None


def test_a_damaged_object_is_an_error(lander: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    subprocess.run(["ar", "x", "liblander_control.a"], cwd=lander[0], check=True)
    whole = (lander[0] / "fcsl_machines-2.o").read_bytes()
    cut = tmp_path / "cut.o"
    for size in range(0, len(whole), 97):
        cut.write_bytes(whole[:size])
        with pytest.raises(ToolchainError, match="ELF"):
            Code([cut])


@pytest.mark.skipif(shutil.which("clang-19") is None, reason="clang-19 compiles for Cortex-M7")
def test_a_cortex_m7(tmp_path: Path) -> None:
    """It needs functions of the compiler's run-time library alone; the library is of ARM, and its constants stay in flash."""
    report = build(LANDER, tmp_path, "cortex-m7")
    assert report["needs"] and all(name.startswith("__aeabi_") for name in report["needs"])
    (machine,) = report["machines"]
    assert machine["functions"]["data"] == machine["descriptor"]["data"] == 0
    assert 100 < machine["stack_bytes"]["step"] < 2000
    subprocess.run(["ar", "x", "liblander_control.a"], cwd=tmp_path, check=True)
    assert (tmp_path / "lander_control-0.o").read_bytes()[18:20] == b"\x28\0"  # EM_ARM
