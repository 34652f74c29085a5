# SPDX-License-Identifier: Apache-2.0
"""The guard in simulation, its Linux extern on files in the kernel's format, and its board on a simulated chip."""

import ctypes
import math
import os
import subprocess
from pathlib import Path

import pytest

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.toolchain import FLAGS, compiler
from simclient import AlgTwin, PyTwin
from simclient.replay import replay

EXAMPLE = Path(__file__).resolve().parents[1]
LED = 17  # as in thermal_guard.json


@pytest.fixture(params=[AlgTwin, PyTwin])
def twin(request):
    """The guard as compiled, and in CPython."""
    with request.param.from_config("../thermal_guard.json") as twin:
        yield twin


def installed(variable, name):
    """Path of a build result of CMake: from the test's environment, or installed."""
    own = os.environ.get(variable)
    return Path(own) if own else package_prefix("thermal_guard") / "lib/thermal_guard" / name


# ---- simulation: a processor at 45 degrees ----------------------------------------------------------------------------


def test_the_led_is_lit_while_the_processor_is_too_hot(twin):
    for limit, lit in ((70.0, False), (44.9, True), (45.0, False), (-10.0, True)):
        twin.set("guard.parameters.limit_c", limit)
        twin.tick()
        assert twin.get_value("guard.outputs.temperature_c") == 45.0
        assert twin.get_value("guard.outputs.hot") is twin.hardware.gpio[LED] is lit
    assert twin.get_value("guard.outputs.health") == "nominal" and twin.hardware.failures == 0


def test_the_pin_is_a_parameter(twin):
    twin.set("guard.parameters.limit_c", 40.0)
    twin.set("guard.parameters.led_pin", 3)
    twin.tick()
    assert twin.hardware.gpio[3] and not twin.hardware.gpio[LED]
    twin.set("guard.parameters.led_pin", 4_000_000_000)  # no such pin: the error is counted, and the guard continues
    twin.tick(2)
    assert twin.hardware.failures == 2 and twin.get_value("guard.outputs.hot") is True


def test_the_guard_is_impure_and_replays_from_its_record(twin, tmp_path):
    assert {f.path for f in twin.fields("guard.outputs")} == {f.path for f in twin.fields("guard.outputs") if f.impure}
    twin.record(tmp_path / "run")
    twin.tick(5)
    twin.set("guard.parameters.limit_c", 40.0)
    twin.tick(5)
    twin.stop_recording()
    verdict = replay(tmp_path / "run", config=str(EXAMPLE / "thermal_guard.json"))
    assert verdict.identical and verdict.ticks == 10


# ---- Linux ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cpu_temp(tmp_path_factory):
    """cpu_temp_c of the Linux source with a test file as thermal zone: text or None (no file) to temperature."""
    folder = tmp_path_factory.mktemp("zone")
    library, zone = folder / "libcpu_temp.so", folder / "temp"
    options = ["-shared", f'-DTHERMAL_ZONE="{zone}"', "-fvisibility=default", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*compiler(), *FLAGS, *options, EXAMPLE / "externs/cpu_temp_linux.c", "-o", library], check=True)
    function = ctypes.CDLL(str(library)).cpu_temp_c
    function.restype = ctypes.c_double

    def read(text):
        zone.unlink(missing_ok=True)
        if text is not None:
            zone.write_text(text)
        return function()

    return read


@pytest.mark.parametrize(
    "text, expected",
    [("45123\n", 45.123), ("-5000\n", -5.0), ("0\n", 0.0), ("70000", 70.0), ("999999999\n", 999999.999)],
)
def test_millidegrees_are_read(cpu_temp, text, expected):
    assert cpu_temp(text) == expected


@pytest.mark.parametrize(
    "text", [None, "", "\n", "-\n", "45.1\n", "hot\n", "0x10\n", "1234567890\n", "9" * 400, "12 \n"]
)
def test_what_is_no_temperature_is_nan(cpu_temp, text):
    assert math.isnan(cpu_temp(text))


def test_the_linux_machine_says_what_this_computer_is_like():
    library = installed("FCSL_TEST_LINUX", "libthermal_guard_linux.so")
    with AlgTwin.from_library(library) as twin:
        twin.tick()
        celsius = twin.get_value("guard.outputs.temperature_c")
        if Path("/sys/class/thermal/thermal_zone0/temp").is_file() and not math.isnan(celsius):
            assert -50.0 < celsius < 150.0 and twin.get_value("guard.outputs.health") == "nominal"
        else:
            assert math.isnan(celsius) and twin.get_value("guard.outputs.health") == "failed"
            assert twin.get_value("guard.outputs.hot") is twin.hardware.gpio[LED] is False
            assert twin.get_value("guard.counters.faults") == 0
    with AlgTwin.from_library(library) as built, AlgTwin.from_config("../thermal_guard.json", target="linux") as own:
        assert built.machine.layout_hash == own.machine.layout_hash


# ---- the board --------------------------------------------------------------------------------------------------------


def test_the_board_claims_lines_and_leaves_them_dark(tmp_path):
    program = tmp_path / "fake_chip"
    sources = [EXAMPLE / "test/fake_chip.c", EXAMPLE / "board/gpiochip.c"]
    wraps = [f"-Wl,--wrap={name}" for name in ("open", "close", "ioctl")]
    include = f"-I{package_prefix('fcsl_compiler')}/include"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-U_FORTIFY_SOURCE", include]
    subprocess.run([*compiler(), *flags, *sources, *wraps, "-o", program], check=True)
    env = {k: v for k, v in os.environ.items() if k != "FCSL_GPIOCHIP"}
    done = subprocess.run([program], capture_output=True, text=True, env=env, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "open /dev/gpiochip0",
        "claim 17 output", "line 17 1", "line 17 0", "line 17 1",
        "claim 4 input",
        "claim 3 input",
        "claim 5 output", "claim 32 output",
        "close 2003", "close 2004", "line 17 0", "close 2017", "close 1000",
    ]  # fmt: skip


def test_fcsl_fc_says_when_there_is_no_chip(tmp_path):
    library = installed("FCSL_TEST_LINUX", "libthermal_guard_linux.so")
    board = installed("FCSL_TEST_BOARD", "libgpiochip.so")
    fc = package_prefix("fcsl_runtime") / "bin/fcsl-fc"
    env = os.environ | {"FCSL_GPIOCHIP": str(tmp_path / "chip")}
    command = [fc, library, "--board", board, "--ticks", "3"]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=60)
    reason = f"fcsl-fc: board '{board}': cannot open {tmp_path}/chip: No such file or directory\n"
    assert (done.returncode, done.stderr) == (1, reason)
