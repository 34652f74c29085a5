# SPDX-License-Identifier: Apache-2.0
"""The wheel of `make wheels` in empty environments: what the README says of it, and the lander's flight with the bits of the workspace.

Builds the wheel. Then pip installs it into two environments in which there is neither ROS nor CMake, cargo or this workspace:

- with the C compiler of this computer, and nothing else, on PATH: a new machine, its tests, a flight, its picture, timed;
- with `fcsl[cc]`, and no compiler on PATH: the same by zig. Then, without zig, the one message that says what to install.

The lander's bags have the digest of a flight in the workspace. fcsl-fc, and the lander that zig has compiled, run on an emulated
processor that has nothing but what every x86-64 has, with the bits of this one's.

The controls: another seed gives another digest, and on that processor an instruction of a newer one ends a program.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..shared.cases import ROOT, CheckFailed, run, write_facts

#: Of the computer's C compiler: what gcc itself calls, too.
_COMPILER = ("cc", "as", "ld")
#: An x86-64 without any extension; static, so that it needs no PATH.
_BASELINE = ("qemu-x86_64-static", "-cpu", "qemu64")
_AVX = 'int main(void) { __asm__ volatile("vxorps %ymm0, %ymm0, %ymm0"); return 0; }\n'
_TICKS = "300"


class Environment:
    """A virtual environment with the wheel, in a folder with a copy of the lander."""

    def __init__(self, folder: Path, wheel: Path, extra: str, tools: Sequence[str]):
        self.folder = folder
        (folder / "tools").mkdir(parents=True)
        for name in tools:
            found = shutil.which(name)
            if found is None:
                raise CheckFailed(f"`{name}` is not installed")
            (folder / "tools" / name).symlink_to(found)
        for part in ("fc", "sim"):
            shutil.copytree(ROOT / "examples/lander" / part, folder / "lander" / part)
        self.seconds: dict[str, float] = {}
        # Not by this environment's own Python, which brings the packages of ROS.
        python = f"{sys.base_prefix}/bin/python3"
        subprocess.run([python, "-m", "venv", folder / "venv"], check=True)
        options = ("--no-cache-dir", "--disable-pip-version-check", "--quiet", "-c", ROOT / "constraints.txt")
        self.run("install", "python3", "-m", "pip", "install", *options, f"{wheel}{extra}")

    @property
    def variables(self) -> dict[str, str]:
        """What a program sees: nothing of the caller, but how to reach the package index."""
        index = {
            name: value
            for name, value in os.environ.items()
            if name.startswith("PIP_") or name.lower().endswith("_proxy")
        }
        path = f"{self.folder}/venv/bin:{self.folder}/tools"
        return index | {"PATH": path, "HOME": str(self.folder), "LC_ALL": "C.UTF-8"}

    def call(self, *line: str | Path) -> subprocess.CompletedProcess[str]:
        program = self.folder / "venv/bin" / line[0]
        given = [program, *line[1:]]
        return subprocess.run(
            given, cwd=self.folder, env=self.variables, capture_output=True, text=True, check=False, timeout=600
        )

    def run(self, step: str, *line: str | Path) -> str:
        """Standard output of a step, which is timed. Raises CheckFailed."""
        begun = time.monotonic()
        done = self.call(*line)
        self.seconds[step] = round(time.monotonic() - begun, 1)
        if done.returncode != 0:
            raise CheckFailed(f"{' '.join(map(str, line))}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
        return done.stdout

    def first_steps(self) -> str:
        """What the README says; the digest of the lander's flight."""
        self.run("new", "fcslc", "new", "machine", "hover")
        self.run("pytest", "pytest", "hover/test")
        self.run("flight", "fcsl-sim", "run", "lander/sim/lander.sim.json", "--record", "flight")
        self.run("plot", "fcsl", "plot", "flight", "-o", "flight.png")
        if not (self.folder / "flight.png").read_bytes().startswith(b"\x89PNG"):
            raise CheckFailed("the plot is no picture")
        return self.digest("flight")

    def digest(self, bag: str) -> str:
        return self.run("digest", "fcsl", "bag", "digest", bag).strip()


def flown_here(folder: Path) -> str:
    """The digest of the lander's flight in the workspace."""
    bag = folder / "workspace"
    run(["fcsl-sim", "run", ROOT / "examples/lander/sim/lander.sim.json", "--record", bag])
    return run(["fcsl", "bag", "digest", bag]).strip()


def same(what: str, digest: str, expected: str) -> None:
    if digest != expected:
        raise CheckFailed(f"the lander {what} has digest {digest}; in the workspace it has {expected}")
    print(f"wheel: the lander {what}: the digest of the workspace, {digest[:12]}…", flush=True)


def without_compiler(environment: Environment) -> None:
    """zig is removed, and with it the last compiler. Raises CheckFailed unless one message names both remedies."""
    environment.run("remove zig", "python3", "-m", "pip", "uninstall", "--quiet", "--yes", "ziglang")
    done = environment.call("fcsl-sim", "run", "lander/sim/lander.sim.json")
    said = done.stderr.splitlines()
    if done.returncode != 2 or len(said) != 1 or not {"gcc", "ziglang"} <= set(said[0].split()):
        raise CheckFailed(f"without a C compiler, not one message with both remedies, but:\n{done.stderr}")
    print(f"wheel: without a compiler: {said[0]}", flush=True)


def on_the_baseline(environment: Environment) -> None:
    """Raises CheckFailed if something was compiled for a newer processor, or has other bits on this one."""
    folder = environment.folder
    environment.run("build", "fcslc", "build", "lander/fc/lander_control.json", "-o", "built")
    prefix = next(folder.glob("venv/lib/python3*/site-packages/fcsl"))
    for name, processor in (("native", ()), ("baseline", _BASELINE)):
        bag = ("--record", folder / name, "--rate", "max", "--ticks", _TICKS)
        run([*processor, prefix / "bin/fcsl-fc", folder / "built/liblander_control.so", *bag])
    if environment.digest("native") != environment.digest("baseline"):
        raise CheckFailed("fcsl-fc has other bits on the oldest processor")
    (folder / "newer.c").write_text(_AVX)
    run(["cc", folder / "newer.c", "-static", "-o", folder / "newer"])
    if subprocess.run([*_BASELINE, folder / "newer"], capture_output=True, check=False).returncode == 0:
        raise CheckFailed(f"{' '.join(_BASELINE)} executes what an old processor does not have")
    print("wheel: on a processor with nothing but what every x86-64 has: the same bits", flush=True)


def check(folder: Path) -> dict[str, Any]:
    begun = time.monotonic()
    run([ROOT / "scripts/wheels.sh"], timeout_s=1200)
    facts: dict[str, Any] = {"build_s": round(time.monotonic() - begun, 1)}
    (wheel,) = (ROOT / "out/wheels").glob("*.whl")
    facts |= {"wheel": wheel.name, "wheel_bytes": wheel.stat().st_size}
    expected = flown_here(folder)

    with_cc = Environment(folder / "cc", wheel, "", _COMPILER)
    same("by this computer's compiler", with_cc.first_steps(), expected)
    facts["seconds"] = with_cc.seconds.copy()
    with_cc.run("seed", "fcsl-sim", "run", "lander/sim/lander.sim.json", "--seed", "2", "--record", "other")
    if with_cc.digest("other") == expected:
        raise CheckFailed("the digest does not notice another seed")

    with_zig = Environment(folder / "zig", wheel, "[cc]", ())
    same("by zig", with_zig.first_steps(), expected)
    facts["seconds_with_zig"] = with_zig.seconds.copy()
    on_the_baseline(with_zig)
    without_compiler(with_zig)
    for name in ("seconds", "seconds_with_zig"):
        spent = facts[name]
        del spent["digest"]
        print(
            f"wheel: {', '.join(f'{step} {s} s' for step, s in spent.items())}: {sum(spent.values()):.0f} s", flush=True
        )
    return facts


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    try:
        with tempfile.TemporaryDirectory(prefix="fcsl-wheel-") as folder:
            write_facts("wheel", check(Path(folder)))
    except CheckFailed as error:
        print(f"wheel: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
