# SPDX-License-Identifier: Apache-2.0
"""`fcsl board`: what it writes. FCSL_UPDATE_GOLDEN=1 rewrites the golden plan."""

import json
import math
import os
import re
import struct
from itertools import zip_longest
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
from fcsl_test_boards import (
    BOARD,
    FIRST,
    IMU,
    MACHINE,
    OUT,
    REMOVED,
    edited,
    found,
    place,
    write_board,
    write_machine,
)

from fcsl_compiler.board.board import check_board
from fcsl_compiler.board.drivers import known_drivers
from fcsl_compiler.board.kinds import KINDS, MAX_BACKENDS, MAX_SECTIONS, STICKS
from fcsl_compiler.board.limits import (
    MAX_CONVERTERS,
    MAX_DEVICES,
    MAX_OUTPUTS,
    MAX_PINS,
    MAX_PLAN_NAME,
    MAX_PULSES,
    MAX_REGISTERS,
    MAX_SENSORS,
)
from fcsl_compiler.board.plan import plan_text
from fcsl_compiler.cli.main import main

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).parent / "golden" / "board.plan.txt"
#: Between two C libraries.
ULPS = 4


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_machine(tmp_path)
    return tmp_path


# ---- the plan ----------------------------------------------------------------------------------------------------------


def is_golden(text: str) -> bool:
    """Whether a plan is the golden one. The coefficients of filters depend on the tan and cos of the C library, and the checksum
    on them."""
    pairs = list(zip_longest(without_checksum(text).splitlines(), GOLDEN.read_text().splitlines(), fillvalue=""))
    return all(
        one == other or (one[:8] == other[:8] == "section " and are_close(one.split()[1:], other.split()[1:]))
        for one, other in pairs
    )


def without_checksum(text: str) -> str:
    body, _, checksum = text.rpartition("end ")
    return f"{body}end\n" if checksum == f"{crc32(body.encode()):08x}\n" else text


def are_close(one: list[str], other: list[str]) -> bool:
    """Whether sections of one quantity differ by a few units in the last place."""
    return one[0] == other[0] and all(
        abs(ordinal(a) - ordinal(b)) <= ULPS for a, b in zip(one[1:], other[1:], strict=True)
    )


def ordinal(bits: str) -> int:
    """Of a double: neighbours differ by 1."""
    (number,) = struct.unpack(">q", bytes.fromhex(bits))
    return int(number) if number >= 0 else -(int(number) & (1 << 63) - 1)


def test_plan(folder: Path) -> None:
    text = plan_text(check_board(write_board(folder, BOARD)))
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        GOLDEN.write_text(without_checksum(text))
    assert is_golden(text), "if that is meant, FCSL_UPDATE_GOLDEN=1 rewrites it"


@pytest.mark.parametrize("toward", [-math.inf, math.inf])
def test_plan_with_another_libm(toward: float, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tan, cos = math.tan, math.cos
    monkeypatch.setattr("fcsl_compiler.board.filters.math.tan", lambda x: math.nextafter(tan(x), toward))
    monkeypatch.setattr("fcsl_compiler.board.filters.math.cos", lambda x: math.nextafter(cos(x), toward))
    text = plan_text(check_board(write_board(folder, BOARD)))
    assert text != GOLDEN.read_text() and is_golden(text)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("section gyro 3fa79e966a97b7b2", "section gyro 3fa79e966a97b7c2"),
        ("section gyro 3fa79e966a97b7b2", "section accel 3fa79e966a97b7b2"),
        ("limits gyro c041800000000000", "limits gyro c041800000000001"),
        ("end\n", ""),
    ],
    ids=["coefficient", "quantity", "limit", "end"],
)
def test_other_plans_are_not_golden(old: str, new: str) -> None:
    golden = GOLDEN.read_text()
    assert is_golden(golden) and not is_golden(golden.replace(old, new, 1))


def test_equal_boards_have_equal_plans(folder: Path) -> None:
    """The order of keys is of no importance where the plan has one of its own."""
    reversed_imu = dict(reversed(BOARD["sensors"]["imu"]["channels"].items()))
    first = plan_text(check_board(write_board(folder, BOARD)))
    assert plan_text(check_board(write_board(folder, edited(*IMU, "channels", value=reversed_imu)))) == first


def test_kinds_are_those_of_the_runtime() -> None:
    text = (ROOT / "fcsl_hal/src/frontends/kinds.c").read_text().replace("FCSL_STICKS_MAX", str(STICKS.count))
    names = dict(re.findall(r"\[FCSL_\w+\] = KIND\(\"(\w+)\", (\w+)\)", text))
    rows = {}
    for kind, array in names.items():
        body = re.search(rf"\b{array}\[\] = \{{(.*?)\}};", text, re.DOTALL)
        assert body is not None
        rows[kind] = re.findall(r'\{"(\w+)", "([^"]*)", (\d+), (\d+), ([01])\}', body[1])
    known = {
        kind: [(q.name, q.unit or "", str(q.count), str(int(q.measured))) for q in quantities]
        for kind, quantities in KINDS.items()
    }
    assert {kind: [(n, u, c, g) for n, u, _, c, g in of_kind] for kind, of_kind in rows.items()} == known


def test_each_row_of_the_table_of_drivers_is_a_driver_in_a_folder() -> None:
    """fcsl_hal builds those that its table lists, and the compiler reads the same table."""
    sources = "".join(f.read_text() for f in sorted((ROOT / "fcsl_hal/src/drivers").glob("*/driver_*.c")))
    rows = re.findall(r"^const fcsl_driver_t \w+ = \{(.*?)^\};", sources, re.DOTALL | re.MULTILINE)
    found = {}
    for row in rows:
        (name,), (direction,) = re.findall(r'\.name = "(\w+)"', row), re.findall(r"\.direction = FCSL_(\w+)", row)
        found[name] = "actuator" if direction == "ACTUATOR" else "waits" if ".waits = 1" in row else "polled"
    kinds = {name: driver.kind for name, driver in known_drivers().items()}
    assert found == {n: k.replace("buffered", "waits").replace("waiting", "waits") for n, k in kinds.items()}


def test_drivers_are_unknown_without_the_hal(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    assert main(["board", str(write_board(folder, BOARD))]) == 1
    assert "package `fcsl_hal` is not installed" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("header", "limits"),
    [
        (
            "fcsl_hal/include/fcsl/fcsl_frontend.h",
            {"FCSL_BACKENDS_MAX": MAX_BACKENDS, "FCSL_SECTIONS_MAX": MAX_SECTIONS, "FCSL_STICKS_MAX": STICKS.count},
        ),
        (
            "fcsl_runtime/fcsl_runtime/board/board_plan.h",
            {
                "BOARD_DEVICES_MAX": MAX_DEVICES,
                "BOARD_SENSORS_MAX": MAX_SENSORS,
                "BOARD_OUTPUTS_MAX": MAX_OUTPUTS,
                "BOARD_PULSES_MAX": MAX_PULSES,
                "BOARD_NAME_BYTES": MAX_PLAN_NAME + 1,
                "BOARD_PINS_MAX": MAX_PINS,
                "BOARD_CONVERTERS_MAX": MAX_CONVERTERS,
                "BOARD_REGISTERS_MAX": MAX_REGISTERS,
            },
        ),
    ],
    ids=["frontend", "plan"],
)
def test_limits_are_those_of_the_runtime(header: str, limits: dict[str, int]) -> None:
    text = (ROOT / header).read_text()
    for name, limit in limits.items():
        assert re.search(rf"\b{name} = (\d+)", text)[1] == str(limit), name  # type: ignore[index]


@pytest.mark.parametrize(
    ("sensor", "edit", "max_age_s"),
    [
        ("imu", {"tick_hz": 200, "states": {"RUN": {"schedule": {"law": 200}}}}, 0.02),
        ("baro", {}, 1.0),  # 3 periods
        ("rc", {}, 0.5),
        ("imu", {"tick_hz": 20, "states": {"RUN": {"schedule": {"law": 20}}}}, 0.1),  # 2 ticks
    ],
)
def test_default_age(sensor: str, edit: dict[str, Any], max_age_s: float, folder: Path) -> None:
    write_machine(folder, **edit)
    board = check_board(write_board(folder, edited(*IMU, "health", value={})))
    health = next(s for s in board.sensors if s.name == sensor).health
    assert (health.max_age_s, health.recover_s) == (pytest.approx(max_age_s), 1.0)


@pytest.mark.parametrize("names", [("imu_top", "bmp"), ("bmp", "imu_top")])
def test_default_age_is_that_of_the_slowest_backend(names: tuple[str, str], folder: Path) -> None:
    board = edited("sensors", "baro", "backends", value=[{"device": name} for name in names])
    assert check_board(write_board(folder, board)).sensors[-1].health.max_age_s == pytest.approx(1.0)


def test_default_age_of_receivers_of_satellites(folder: Path) -> None:
    gnss = {"kind": "gnss", "channels": {"altitude": "baro.pressure"}, "backends": [{"device": "receiver"}]}
    pressure = {**MACHINE["channels"][3], "field": "law.inputs.range"}
    write_machine(folder, channels=[*MACHINE["channels"][:3], pressure, *MACHINE["channels"][4:]])
    board = check_board(write_board(folder, edited("sensors", "baro", value=gnss)))
    assert board.sensors[-1].health.max_age_s == 1.5


# ---- the command -------------------------------------------------------------------------------------------------------


def test_command_writes_beside_the_board(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, BOARD)
    assert main(["board", str(path)]) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{folder / 'board.plan'}\n" and captured.err == ""
    assert is_golden((folder / "board.plan").read_text())
    assert main(["board", str(path), "-o", str(folder / "out" / "x.plan")]) == 0
    assert is_golden((folder / "out" / "x.plan").read_text())


def test_command_writes_nothing_on_errors(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, edited("devices", "bmp", "driver", value="bmp"))
    assert main(["board", str(path)]) == 1
    captured = capsys.readouterr()
    assert captured.out == "" and "error[E503]" in captured.err and "1 error" in captured.err
    assert not (folder / "board.plan").exists()


def test_command_shows_warnings(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, edited("sensors", "baro", value=REMOVED))
    assert main(["board", str(path)]) == 0
    assert set(re.findall(r"warning\[(\w+)\]", capsys.readouterr().err)) == {"W501", "W502"}


def test_command_as_document(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, BOARD)
    assert main(["board", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] and document["machines"][0]["output"] == str(folder / "board.plan")
    path.write_text("{")
    assert main(["board", str(path), "--json"]) == 1
    assert [d["code"] for d in json.loads(capsys.readouterr().out)["diagnostics"]] == ["E101"]


def test_command_keeps_the_board(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, BOARD)
    assert main(["board", str(path), "-o", str(path)]) == 2
    assert "would replace" in capsys.readouterr().err and json.loads(path.read_text()) == BOARD
    assert main(["board", str(folder / "none.json")]) == 2
    assert main(["board", str(folder)]) == 1
    assert "E100" in capsys.readouterr().err


# ---- the machine -------------------------------------------------------------------------------------------------------


def test_machine_of_another_folder(folder: Path) -> None:
    (folder / "boards").mkdir()
    board = check_board(write_board(folder / "boards", edited("machine", value="../quad.json")))
    assert board.machine.name == "quad"


def test_machine_of_a_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    prefix = folder / "prefix"
    (prefix / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (prefix / "share/ament_index/resource_index/packages/craft").touch()
    (prefix / "share/craft").mkdir()
    write_machine(prefix / "share/craft")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix), prepend=":")
    (folder / "quad.json").unlink()
    assert found(folder, edited("machine", value="package://craft/quad.json")) == []


def test_errors_of_the_machine_come_first(folder: Path) -> None:
    write_machine(folder, initial_state="NOWHERE")
    errors = found(folder, edited("devices", "bmp", "driver", value="bmp"))
    assert [(d.code, d.span.source.name.rpartition("/")[2]) for d in errors] == [
        ("E206", "quad.json"),
        ("E503", "board.json"),
    ]


@pytest.mark.parametrize("machine", ["none.json", "", "x" * 300, "x" * 1001, "a\0b", "package://none/a.json", "."])
def test_a_machine_that_cannot_be_read(machine: str, folder: Path) -> None:
    (error,) = found(folder, edited("machine", value=machine))
    assert error.code == "E502" and place(error) == json.dumps(machine)


def test_what_is_no_machine(folder: Path) -> None:
    assert {d.code for d in found(folder, edited("machine", value="board.json"))} == {"E105"}
    (error,) = found(folder, MACHINE)
    assert error.code == "E501" and "this is a machine, not a board" in error.message


@pytest.mark.parametrize("line", [["check"], ["build", "-o", "out"], ["graph"]])
def test_a_board_is_no_machine(line: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, BOARD)
    command, *options = [str(folder / word) if word == "out" else word for word in line]
    assert main([command, str(path), *options]) == 1
    captured = capsys.readouterr().err
    assert "error[E105]: this is a board, not a machine" in captured and f"`fcsl board {path}` checks it" in captured
    assert not (folder / "out").exists()


# ---- outputs -----------------------------------------------------------------------------------------------------------


def test_a_board_may_be_for_sensors_or_for_outputs(folder: Path) -> None:
    """What it leaves to others has no warnings; devices that nothing uses have."""
    assert {d.code for d in found(folder, edited("outputs", value=REMOVED))} == {"W501"}
    board = edited("sensors", value=REMOVED)
    assert {d.code for d in found(folder, board)} == {"E520"}  # and then no device paces the loop
    del board["pace"]
    assert {d.code for d in found(folder, board)} == {"W501"}


def test_a_channel_that_nothing_drives_on_purpose(folder: Path) -> None:
    board = check_board(write_board(folder, edited("outputs", "force", value=None)))
    assert {d.code for d in board.warnings} == {"W501"}  # of its device
    assert "\nundriven force\n" in plan_text(board)
    (error,) = found(folder, edited("outputs", "imu.gyro", value=None))
    assert error.code == "E515"
    channel = {"name": "ready", "id": 20, "field": "law.outputs.ready", "direction": "actuator"}
    write_machine(folder, channels=[*MACHINE["channels"], channel])
    assert check_board(write_board(folder, edited("outputs", "ready", value=None))).undriven == ("ready",)


@pytest.mark.parametrize(
    "rest",
    [
        {},
        {"sensors": {}},
        {"outputs": {}},
        {"hardware": {}},
        {"hardware": {"gpio": {}, "adc": {}}},
        {"sensors": {}, "outputs": {}},
    ],
)
def test_a_board_for_nothing(rest: dict[str, Any], folder: Path) -> None:
    (error,) = found(folder, {"machine": "quad.json", "devices": {}, **rest})
    assert (error.code, error.message) == ("E202", "a board has no `sensors`, `outputs` or `hardware`")


def test_safe_outputs(folder: Path) -> None:
    """Those of the channel go along the line, also from beyond it."""
    board = edited(*OUT, "elements", 1, value={"signal": "pulse1", "output": [1900, 1100]})
    motors = check_board(write_board(folder, board)).outputs[0]
    assert [p.safe for p in motors.pulses] == [1200.0, 1900.0]
    motors = check_board(write_board(folder, edited(*FIRST, "safe_output", value=1000))).outputs[0]
    assert [p.safe for p in motors.pulses] == [1000.0, 0.0]


def test_a_safe_channel_of_f32(folder: Path) -> None:
    """The runtime has the value in single precision."""
    channels = [*MACHINE["channels"][:-1], {**MACHINE["channels"][-1], "safe": [0.1, 0.0]}]
    write_machine(folder, channels=channels)
    motors = check_board(write_board(folder, edited(*FIRST, "output", value=[0, 1]))).outputs[0]
    assert motors.pulses[0].safe == struct.unpack("f", struct.pack("f", 0.1))[0]


@pytest.mark.parametrize(
    ("field", "why"),
    [
        ("ready", "only f64 and f32 have values between the ends of an output, and it is bool"),
        ("steps", "only f64 and f32 have values between the ends of an output, and it is i32[2]"),
        ("many", "it has more than 16 elements"),
    ],
)
def test_channels_that_cannot_be_outputs(field: str, why: str, folder: Path) -> None:
    channel = {"name": "x", "id": 20, "field": f"law.outputs.{field}", "direction": "actuator"}
    write_machine(folder, channels=[*MACHINE["channels"], channel])
    (error,) = found(folder, edited("outputs", "x", value={"device": "esc", "elements": []}))
    assert (error.code, place(error)) == ("E515", '"x"') and why in error.why


def test_one_signal_of_two_channels(folder: Path) -> None:
    """Also of two devices with one driver and address."""
    element = {"signal": "pulse1", "output": [1000, 2000], "safe_output": 1000}
    board = edited("outputs", "force", value={"device": "other", "elements": [element]})
    board["devices"]["other"] = BOARD["devices"]["esc"]
    del board["devices"]["valve"]
    (error,) = found(folder, board)
    assert error.code == "E519" and [n.text for n in error.notes] == ["the other"]
    board["devices"]["other"] = {"driver": "pwm", "device": "pwmchip1"}
    assert found(folder, board) == []


def test_outputs_without_a_machine(folder: Path) -> None:
    """What does not depend on the machine is checked all the same."""
    board = edited(*FIRST, "safe_output", value=1)
    board["machine"] = "none.json"
    assert [d.code for d in found(folder, board)] == ["E502", "E516"]


@pytest.mark.parametrize(("driver", "signals"), [("gpio_out", ["line0", "line1"]), ("pwm", ["pulse2", "pulse1"])])
def test_devices_of_actuators_have_no_period(driver: str, signals: list[str], folder: Path) -> None:
    board = edited("devices", "esc", "driver", value=driver)
    for element, signal in zip(board["outputs"]["motors"]["elements"], signals, strict=True):
        element["signal"] = signal
    assert f"device esc 0 {driver} pwmchip0" in plan_text(check_board(write_board(folder, board)))


def test_too_many_outputs(folder: Path) -> None:
    outputs = {f"x{i}": {"device": "esc", "elements": []} for i in range(MAX_OUTPUTS)}
    board = edited("outputs", value=BOARD["outputs"] | outputs)
    assert [d.message for d in found(folder, board) if d.code == "E505"] == ["18 outputs"]


def test_a_channel_without_an_output(folder: Path) -> None:
    board = edited("outputs", "force", value=REMOVED)
    del board["devices"]["valve"]
    (warning,) = found(folder, board)
    assert (warning.code, place(warning)) == ("W506", '"quad.json"')
    assert warning.message == "no output drives channel `force`"


def test_a_bus_waits(folder: Path) -> None:
    can = {"driver": "can", "device": "can0"}
    assert found(folder, edited("devices", "cells", value=can)) == []
    (error,) = found(folder, edited("devices", "cells", value={**can, "rate_hz": 1}))
    assert error.code == "E504"
