# SPDX-License-Identifier: Apache-2.0
"""What users wait for at once imports only what it needs: help, errors of usage, fcsl var, `import simclient`."""

from __future__ import annotations

import subprocess
import sys

import pytest

#: They take long to load, or load much.
HEAVY = {"asyncio", "ctypes", "dataclasses", "inspect", "matplotlib", "numpy", "rclpy", "rosbags", "tempfile"}
PARSER = {
    "base",
    "base.command",
    "base.examples",
    "base.version",
    "cli",
    "cli.arguments",
    "cli.main",
    "model",
    "model.choices",
}
VERSION = {
    f"fcsl_compiler{part}"
    for part in (
        "",
        ".api",
        ".api.command_line",
        ".base",
        *(f".base.{n}" for n in ("command", "examples", "verb", "version")),
    )
}
PACKAGES = {"fcsl_compiler.api.packages", "fcsl_compiler.base.packages"}
CLIENT = {"cli", "errors", "vars", "vars.arguments", "vars.cli"}
READING = {f"vars.{name}" for name in ("answers", "client", "find", "read", "show", "subscription", "wire")}
FCSLC = "from fcsl_compiler.cli.main import main; main({})"
FCSL_SIM = "from fcsl_sim.cli import main; main({})"
FCSL_VAR = "import simclient.cli; from simclient.vars.cli import main; main({})"


def loaded(statements: str) -> set[str]:
    """Full names of all modules that a fresh interpreter has loaded when these statements end."""
    script = f"import sys\ntry:\n    {statements}\nexcept SystemExit: pass\nprint('loaded:', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.rpartition("loaded:")[2].split())


def assert_light(modules: set[str], package: str, own: set[str]) -> None:
    ours = {name for name in modules if name.partition(".")[0] in ("fcsl_compiler", "simclient", "fcsl_sim")}
    assert ours <= {package, *(f"{package}.{name}" for name in own)} | VERSION
    assert modules & HEAVY == set()


@pytest.mark.parametrize("arguments", (["--help"], ["--version"], ["nope"], ["build"], ["check", "--help"]), ids=str)
def test_fcslc_parses_its_command_line_before_it_loads_a_command(arguments: list[str]) -> None:
    assert_light(loaded(FCSLC.format(arguments)), "fcsl_compiler", PARSER)


@pytest.mark.parametrize("arguments", (["--help"], ["--version"], ["nope"], ["run", "--seed", "x"]), ids=str)
def test_fcsl_sim_parses_its_command_line_before_it_loads_a_command(arguments: list[str]) -> None:
    assert_light(loaded(FCSL_SIM.format(arguments)), "fcsl_sim", {"arguments", "cli", "external"})


@pytest.mark.parametrize("arguments", (["--help"], ["--version"], ["nope"]), ids=str)
def test_fcsl_var_parses_its_command_line_before_it_loads_a_command(arguments: list[str]) -> None:
    assert_light(loaded(FCSL_VAR.format(arguments)), "simclient", CLIENT)


@pytest.mark.parametrize("command", ("list", "get machine.tick", "describe"))
def test_fcsl_var_reads_with_its_client_alone(command: str) -> None:
    arguments = ["--socket", "/nothing/listens/here", *command.split()]
    assert_light(loaded(FCSL_VAR.format(arguments)), "simclient", CLIENT | READING)


def test_simclient_loads_no_twin_before_it_is_used() -> None:
    assert_light(loaded("import simclient"), "simclient", set())


def test_a_twin_loads_neither_numpy_nor_the_compiler() -> None:
    modules = loaded("from simclient import AlgTwin")
    assert "simclient.twin.alg_twin" in modules
    assert {name for name in modules if name.startswith("fcsl_compiler.")} <= VERSION | PACKAGES
    assert modules & (HEAVY - {"ctypes", "dataclasses", "inspect"}) == set()


def test_what_is_loaded_is_found() -> None:
    """Else none of the tests above could fail."""
    modules = loaded(FCSLC.format(["explain", "E402"]))
    assert {"fcsl_compiler.cli.explain", "fcsl_compiler.base.diagnostics", "dataclasses"} <= modules
