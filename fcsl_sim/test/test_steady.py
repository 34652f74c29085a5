# SPDX-License-Identifier: Apache-2.0
"""A running simulation allocates nothing and makes no system call, with any integrator, events, noise and controllers."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.packages import package_prefix
from fcsl_sim import SimConfig

TEST = Path(__file__).resolve().parent
CANNOT = 77
INTEGRATORS: list[dict[str, Any]] = [
    *({"method": method, "hz": 1000} for method in ("euler", "rk2", "rk4", "ab4")),
    {"method": "rk45", "rtol": 1e-9, "atol": 1e-9},
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("steady") / "steady_sim"
    prefixes = [package_prefix(name) for name in ("fcsl_sim", "fcsl_runtime", "fcsl_hal", "fcsl_compiler")]
    options = [f"-I{prefix}/include" for prefix in prefixes] + [f"-L{prefix}/lib" for prefix in prefixes]
    options.append(f"-I{TEST.parents[1]}/fcsl_hal/test/support")
    options += [f"-Wl,-rpath,{prefix}/lib" for prefix in prefixes]
    line = [
        "cc",
        "-std=c11",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Werror",
        TEST / "programs/steady_sim.c",
        "-o",
        path,
        *options,
    ]
    subprocess.run([*map(str, line), "-lfcsl_sim", "-lfcsl_run", "-lm"], check=True)
    return path


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_it_allocates_nothing(
    integrator: dict[str, Any], program: Path, load_sim: Callable[..., SimConfig], tmp_path: Path
) -> None:
    def change(config: dict[str, Any]) -> None:
        config["integrator"] = integrator
        config["instances"]["altimeter"]["parameters"]["sigma"] = 0.5
        config["models"]["ball"] = {"source": "ball.c"}
        ball = {"gravity": 9.81, "restitution": 0.7, "rest_speed": 0.5, "height": 0.3}
        config["instances"]["ball"] = {"model": "ball", "parameters": ball}
        config["events"] = [{"at_s": 0.5, "set": "ball.inputs.push", "value": 30.0}]

    (tmp_path / "plan").write_text(load_sim(change).plan.text)
    done = subprocess.run([str(program), str(tmp_path / "plan")], capture_output=True, text=True, check=False)
    if done.returncode == CANNOT:
        pytest.skip("this kernel has no seccomp")
    assert (done.returncode, done.stdout) == (0, "0 allocations\n"), done.stderr
