# SPDX-License-Identifier: Apache-2.0
"""The native packages built with a sanitizer, in a folder of their own, and the tools that build what tests compile."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from ..shared.cases import OUT, ROOT, CheckFailed, run

PACKAGES = ("fcsl_compiler", "fcsl_hal", "fcsl_runtime", "fcsl_sim")
GCC = "/usr/bin/gcc"
#: Programs of ours, whose leaks are looked for; those of others (Python, a C compiler) leak what they like at their end.
PROGRAMS = ("fcsl-fc", "fcsl-guard", "wire_sim", "mcap_write", "control", "layout")
#: C test programs with threads of their own or around a machine: TSan is for them and for the tests of fcsl-fc.
THREADED = "test_latest|test_bus_queues|test_ring|test_history|test_wire_pair|test_guard_slot|test_run|test_allocation|test_telemetry"
_COMMON = ("-fno-omit-frame-pointer", "-fno-sanitize-recover=all")
#: float-cast-overflow: undefined in C, and no part of -fsanitize=undefined.
_FLAGS = {
    "address": (*_COMMON, "-fsanitize=address,undefined,float-cast-overflow"),
    "thread": (*_COMMON, "-fsanitize=thread"),
}
#: LeakSanitizer says this of a thread that ends while it looks for leaks, as on a busy computer.
_NO_FINDING = re.compile(r"^==\d+==Unable to get registers from thread \d+\.$", re.MULTILINE)
#: Last on the line, so in place of any other: gcc needs minutes to optimise a large generated machine with all its checks, and
#: a third of the time this way. The check `bits` shows that levels change no bit.
_LEVEL = ("-O1", "-g1")
#: Links what holds the Rust library in a quarter of the time that ld needs.
_LLD = "-B/usr/lib/llvm-19/bin -fuse-ld=lld"


@dataclass(frozen=True)
class Build:
    """The packages under one sanitizer: "address" (with UBSan) or "thread"."""

    kind: str

    @property
    def folder(self) -> Path:
        return OUT / f"sanitize-{self.kind}"

    @property
    def flags(self) -> tuple[str, ...]:
        return _FLAGS[self.kind]

    @property
    def reports(self) -> Path:
        """A file here is a finding, whoever swallowed its words."""
        return self.folder / "reports"

    @property
    def compiler(self) -> str:
        """gcc with the flags."""
        return str(self.folder / "bin" / "cc")

    def package(self, name: str) -> Path:
        return self.folder / "build" / name

    def make(self) -> None:
        """Builds what changed. Raises CheckFailed with the end of what the build said."""
        self._make_tools()
        cargo = self.package("fcsl_hal") / "cargo"
        if not cargo.exists() and (ROOT / "build/fcsl_hal/cargo").exists():
            # Rust is the same with or without a sanitizer for C; cargo sees that there is nothing to do.
            cargo.parent.mkdir(parents=True, exist_ok=True)
            cargo.symlink_to(ROOT / "build/fcsl_hal/cargo")
        packages, tests, below = ["--packages-up-to", "fcsl_sim"], [], ""
        if self.kind == "thread":  # fcsl_math and fcsl_sim have no threads: the workspace's own are used
            packages = ["--packages-select", "fcsl_hal", "fcsl_runtime"]
            tests = [f"-DFCSL_C_TESTS={THREADED}|wire_sim|mcap_write"]
            below = "COLCON_CURRENT_PREFIX=$PWD/install/fcsl_compiler . install/fcsl_compiler/share/fcsl_compiler/package.sh; "
        line = [
            *("colcon", "--log-base", str(self.folder / "log"), "build", *packages),
            *("--build-base", str(self.folder / "build"), "--install-base", str(self.folder / "install")),
            *("--cmake-args", "-DCMAKE_BUILD_TYPE=Release", f"-DCMAKE_C_COMPILER={self.compiler}"),
            *(f"-DCMAKE_{kind}_LINKER_FLAGS={_LLD}" for kind in ("EXE", "SHARED", "MODULE")),
            *tests,
        ]
        # As scripts/build.sh: on the underlay alone, whatever the calling shell had sourced.
        script = (
            f"unset CC AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH PYTHONPATH; . scripts/underlay.sh; {below}"
            f"if type -P ninja > /dev/null; then export CMAKE_GENERATOR=Ninja; fi; {shlex.join(line)}"
        )
        done = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            logs = sorted((self.folder / "log/latest_build").glob("*/stderr.log"))
            said = "\n".join(log.read_text(errors="replace")[-2000:] for log in logs)
            raise CheckFailed(f"the build with -fsanitize={self.kind} failed\n{done.stderr[-2000:]}\n{said}")

    def _make_tools(self) -> None:
        """`cc` and `gcc` that add flags and level, an `nm` that hides the sanitizers' own names, and what every process loads."""
        tools = self.folder / "bin"
        tools.mkdir(parents=True, exist_ok=True)
        for name in ("cc", "gcc"):
            line = f'{GCC} {" ".join(self.flags)} "$@" {" ".join(_LEVEL)}'
            _write_program(tools / name, f"unset LD_PRELOAD\nexec {line}\n")
        names = "__asan_|__ubsan_|__sanitizer_|__tsan_"
        nm = f'unset LD_PRELOAD\nout=$(/usr/bin/nm "$@") || exit $?\nprintf "%s\\n" "$out" | sed -E "/({names})/d"\n'
        _write_program(tools / "nm", nm)
        source = Path(__file__).resolve().parent / "preload.c"
        flags = ["-shared", "-fPIC", f'-DPROGRAMS=" {" ".join(PROGRAMS)} "', "-Wl,--no-as-needed"]
        run([GCC, *flags, source, "-lubsan", "-o", self.folder / "preload.so"])

    def environment(self) -> dict[str, str]:
        """For the tests: this build's programs, and for "address" its libraries and the tools above for Python, too.

        A Python process cannot load what TSan has instrumented, so it keeps the plain libraries then.
        """
        own = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        runtime = self.package("fcsl_runtime")
        prefixes = [str(self.folder / "install" / p) for p in PACKAGES]
        own["LD_LIBRARY_PATH"] = _before(own, "LD_LIBRARY_PATH", *(f"{p}/lib" for p in prefixes))
        programs = {"FC": "fcsl-fc", "GUARD": "fcsl-guard", "WIRE_SIM": "wire_sim", "MCAP_WRITE": "mcap_write"}
        own |= {f"FCSL_TEST_{name}": str(runtime / program) for name, program in programs.items()}
        report = f"log_path={self.reports / 'report'}"
        if self.kind == "thread":
            return own | {"TSAN_OPTIONS": f"{report}:halt_on_error=1"}
        # A process that is not instrumented, as Python, must load the runtime of what it loads later before all else.
        runtimes = f"{run([GCC, '-print-file-name=libasan.so']).strip()} {self.folder / 'preload.so'}"
        return own | {
            "AMENT_PREFIX_PATH": _before(own, "AMENT_PREFIX_PATH", *prefixes),
            "PATH": _before(own, "PATH", str(self.folder / "bin"), *(f"{p}/bin" for p in prefixes)),
            "NM": str(self.folder / "bin/nm"),
            "FCSL_CACHE_DIR": str(self.folder / "cache"),
            "FCSL_TEST_FIXTURE": str(runtime / "libfixture.so"),
            "FCSL_TEST_FIXTURE_TWIN": str(runtime / "libfixture_twin.so"),
            "FCSL_TEST_RUN_LIBRARY": str(runtime / "libfcsl_run.so"),
            "FCSL_TEST_PROGRAMS": str(self.package("fcsl_hal")),
            "ASAN_OPTIONS": f"{report}:detect_stack_use_after_return=1:strict_string_checks=1",
            "UBSAN_OPTIONS": "print_stacktrace=1",
            "FCSL_SANITIZER_REPORTS": str(self.reports / "report"),
            "LD_PRELOAD": runtimes,
        }

    def findings(self) -> list[str]:
        """The reports that processes left, each with its file."""
        files = sorted(self.reports.glob("*")) if self.reports.is_dir() else []
        texts = {file: file.read_text(errors="replace") for file in files}
        return [f"{file}:\n{text[:3000]}" for file, text in texts.items() if _NO_FINDING.sub("", text).strip()]


def _before(own: dict[str, str], name: str, *entries: str) -> str:
    """A list of folders with these in front."""
    return os.pathsep.join([*entries, *filter(None, [own.get(name)])])


def _write_program(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}")
    path.chmod(0o755)
