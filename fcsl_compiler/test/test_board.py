# SPDX-License-Identifier: Apache-2.0
"""`fcslc board`: what it writes, and what it reports where. FCSL_UPDATE_GOLDEN=1 rewrites the golden plan."""

import json
import math
import os
import re
import struct
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_boards import BOARD, MACHINE, edited, write_board, write_machine

from fcsl_compiler.base.diagnostics import Diagnostic, DiagnosticError
from fcsl_compiler.board.board import check_board
from fcsl_compiler.board.devices import ACTUATORS, BUFFERED, POLLED, WAITING
from fcsl_compiler.board.kinds import KINDS, MAX_BACKENDS, MAX_SECTIONS, STICKS
from fcsl_compiler.board.limits import MAX_DEVICES, MAX_OUTPUTS, MAX_PLAN_NAME, MAX_PULSES, MAX_SENSORS
from fcsl_compiler.board.plan import plan_text
from fcsl_compiler.cli.main import main

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).parent / "golden" / "board.plan.txt"
IMU = ("sensors", "imu")
TOP = (*IMU, "backends", 0)
OUT = ("outputs", "motors")
FIRST = (*OUT, "elements", 0)
REMOVED: Any = ...
#: Between two C libraries.
ULPS = 4


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_machine(tmp_path)
    return tmp_path


def found(folder: Path, board: Any) -> list[Diagnostic]:
    """All errors, or all warnings if there are none."""
    try:
        return list(check_board(write_board(folder, board)).warnings)
    except DiagnosticError as error:
        return list(error.diagnostics)


def place(diagnostic: Diagnostic) -> str:
    """The text that a diagnostic points at."""
    start, end = diagnostic.span.source.offsets(diagnostic.span)
    return diagnostic.span.source.text[start:end]


# ---- the plan ----------------------------------------------------------------------------------------------------------


def is_golden(text: str) -> bool:
    """Whether a plan is the golden one. The coefficients of filters depend on the tan and cos of the C library."""
    pairs = list(zip_longest(text.splitlines(), GOLDEN.read_text().splitlines(), fillvalue=""))
    return all(
        one == other or (one[:8] == other[:8] == "section " and are_close(one.split()[1:], other.split()[1:]))
        for one, other in pairs
    )


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
        GOLDEN.write_text(text)
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
    text = (ROOT / "fcsl_hal/src/frontends/kinds.c").read_text()
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


def test_drivers_are_those_that_come_with_fcsl() -> None:
    sources = "".join(f.read_text() for f in sorted((ROOT / "fcsl_hal/src/drivers").glob("driver_*.c")))
    rows = re.findall(r"^const fcsl_driver_t \w+ = \{(.*?)^\};", sources, re.DOTALL | re.MULTILINE)
    found: dict[tuple[str, bool], set[str]] = {}
    for row in rows:
        name, direction = re.findall(r'\.name = "(\w+)"|\.direction = FCSL_(\w+)', row)
        found.setdefault((direction[1], ".waits = 1" in row), set()).add(name[0])
    assert found == {
        ("SENSOR", False): set(POLLED),
        ("SENSOR", True): {*BUFFERED, *WAITING},
        ("ACTUATOR", False): set(ACTUATORS),
    }


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
    assert main(["board", str(path), "--format", "json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] and document["machines"][0]["output"] == str(folder / "board.plan")
    path.write_text("{")
    assert main(["board", str(path), "--format", "json"]) == 1
    assert [d["code"] for d in json.loads(capsys.readouterr().out)["diagnostics"]] == ["E101"]


def test_command_keeps_the_board(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_board(folder, BOARD)
    assert main(["board", str(path), "-o", str(path)]) == 2
    assert "would replace" in capsys.readouterr().err and json.loads(path.read_text()) == BOARD
    assert main(["board", str(folder / "none.json")]) == 1
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
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
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
    assert "error[E105]: this is a board, not a machine" in captured and f"`fcslc board {path}` checks it" in captured
    assert not (folder / "out").exists()


# ---- diagnostics, and where they point ---------------------------------------------------------------------------------

EDITS: Sequence[tuple[Any, str, str, str]] = [
    # devices
    (edited("devices", "bmp", "driver", value="ioo"), "E503", "no driver `ioo`", '"ioo"'),
    (edited("devices", "bmp", "driver", value="lib.so:"), "E503", "no driver `lib.so:`", '"lib.so:"'),
    (edited("devices", "bmp", "driver", value="./my lib.so:x"), "E503", "no driver", '"./my lib.so:x"'),
    (edited("devices", "bmp", "rate_hz", value=REMOVED), "E504", "device `bmp` has no `rate_hz`", "{"),
    (edited("devices", "imu_top", "rate_hz", value=REMOVED), "E504", "device `imu_top` has no `rate_hz`", "{"),
    (edited("devices", "receiver", "rate_hz", value=50), "E504", "device `receiver` has a rate", "50"),
    (edited("devices", "bmp", "rate_hz", value=0), "E204", "`rate_hz` is 0", "0"),
    (edited("devices", "bmp", "rate_hz", value=100001), "E204", "`rate_hz` is 100001", "100001"),
    (edited("devices", "bmp", "device", value=" "), "E505", "`device` is empty", '" "'),
    (edited("devices", "bmp", "device", value="a\nend"), "E505", "`device` has a control character", '"a\\nend"'),
    (edited("devices", "bmp", "device", value="ä" * 251), "E505", "`device` is longer than 500 bytes", '"'),
    (edited("devices", "esc", "rate_hz", value=50), "E504", "device `esc` has a rate", "50"),
    # names and counts
    (edited("sensors", "s" * 65, value=BOARD["sensors"]["baro"]), "E505", "longer than 64 characters", '"sss'),
    (
        edited("devices", value=BOARD["devices"] | {f"d{i}": BOARD["devices"]["bmp"] for i in range(25)}),
        "E505",
        "33 devices",
        "{",
    ),
    # kinds and channels
    (edited(*IMU, "kind", value="inertail"), "E205", "`kind` cannot be `inertail`", '"inertail"'),
    (edited(*IMU, "channels", "field", value="imu.gyro"), "E506", "kind `inertial` has", '"field"'),
    (edited(*IMU, "channels", value={}), "E509", "a sensor without channels", "{}"),
    (edited(*IMU, "channels", "gyro", value="imu.gyros"), "E206", "no channel `imu.gyros`", '"imu.gyros"'),
    (edited(*IMU, "channels", "gyro", value="force"), "E507", "that is an actuator", '"force"'),
    (
        edited(*IMU, "channels", "gyro", value="baro.pressure"),
        "E507",
        "3 elements, and the channel 1",
        '"baro.pressure"',
    ),
    (edited(*IMU, "channels", "gyro", value="imu.accel"), "E507", "in rad/s, and the channel in m/s^2", '"imu.accel"'),
    (edited("sensors", "rc", "channels", "failsafe", value="rc.sticks"), "E507", "1 elements", '"rc.sticks"'),
    (
        edited("sensors", "battery", "channels", value={"voltage": "battery.voltage", "current": "battery.voltage"}),
        "E508",
        "two sources for channel `battery.voltage`",
        '"battery.voltage"',
    ),
    # backends
    (edited(*IMU, "backends", value=[]), "E509", "a sensor with 0 backends", "[]"),
    (
        edited("sensors", "baro", "backends", value=[{"device": d} for d in list(BOARD["devices"])[:5]]),
        "E509",
        "with 5 backends",
        "[",
    ),
    (edited(*IMU, "backends", 2, "device", value="imu_top"), "E509", "device `imu_top` twice", '"imu_top"'),
    (edited(*IMU, "backends", 2, "device", value="imu_fra"), "E206", "no device `imu_fra`", '"imu_fra"'),
    (edited(*TOP, "signals", value={"gyro": "a b"}), "E203", "`a b` is not the name of a signal", '"a b"'),
    (edited(*TOP, "signals", value={"delta_angle": "a"}), "E506", "kind `inertial` measures", '"delta_angle"'),
    # rotations
    (edited(*TOP, "rotation", value="yaw_90_roll_180"), "E510", "no rotation `yaw_90_roll_180`", '"yaw_90_roll_180"'),
    (edited(*TOP, "rotation", value=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), "E510", "it is a reflection", "[["),
    (edited(*TOP, "rotation", value=[[1, 0, 0], [0, 1.1, 0], [0, 0, 1]]), "E510", "row 2 has the length 1.1", "[["),
    (edited(*TOP, "rotation", value=[[1, 0, 0], [0.6, 0.8, 0], [0, 0, 1]]), "E510", "rows 1 and 2", "[["),
    (edited(*TOP, "rotation", value=[[1, 0], [0, 1]]), "E207", "`rotation` is f64[3][3]", "[["),
    (
        edited("sensors", "baro", "backends", 0, "rotation", value="yaw_90"),
        "E510",
        "a rotation of a sensor of kind `barometer`",
        '"yaw_90"',
    ),
    # corrections
    (edited(*TOP, "correct", value={"delta_time": {}}), "E506", "can correct or filter", '"delta_time"'),
    (edited(*TOP, "correct", value={"gyro": {"offset": 1}}), "E207", "`offset` is f64[3]", "1"),
    (edited(*TOP, "correct", value={"temperature": {"offset": [1]}}), "E207", "`offset` is f64", "[1]"),
    (edited(*TOP, "correct", value={"gyro": {"scale": [1, 2]}}), "E207", "`scale` is f64[3]", "[1, 2]"),
    (edited(*TOP, "correct", value={"gyro": {"scale": [[1, 0, 0]] * 3}}), "E511", "loses the reading", "[["),
    (edited(*TOP, "correct", value={"temperature": {"scale": 0}}), "E511", "loses the reading", "0"),
    (edited(*TOP, "correct", value={"temperature": {"per_kelvin": 1}}), "E511", "`per_kelvin` of `temperature`", "1"),
    (
        edited("sensors", "battery", "backends", 0, "correct", value={"voltage": {"celsius": -300}}),
        "E204",
        "`celsius` is -300",
        "-300",
    ),
    (
        edited(
            *("sensors", "baro"),
            value={
                "kind": "value",
                "channels": {"value": "baro.pressure"},
                "backends": [{"device": "bmp", "correct": {"value": {"per_kelvin": 1}}}],
            },
        ),
        "E511",
        "`per_kelvin` of `value`",
        "1",
    ),
    # sticks
    (edited(*TOP, "sticks", value=[]), "E512", "`sticks` of a sensor of kind `inertial`", "[]"),
    (edited("sensors", "rc", "backends", 0, "sticks", value=[{}] * 19), "E512", "19 sticks", "["),
    (
        edited("sensors", "rc", "backends", 0, "sticks", value=[{"middle": 2000}]),
        "E512",
        "the middle (2000) is not between 1000 and 2000",
        '{"middle": 2000}',
    ),
    (
        edited("sensors", "rc", "backends", 0, "sticks", value=[{"middle": 1400, "deadband": 400}]),
        "E512",
        "a deadband of 400 leaves nothing",
        '{"middle"',
    ),
    # health
    (edited(*IMU, "health", "max_age_s", value=0.002), "E513", "`imu_side` has a reading every 0.002 s", "0.002"),
    (edited(*IMU, "health", "limits", value={"gyro": [1, 1]}), "E513", "no `gyro` is between 1 and 1", "[1, 1]"),
    (edited(*IMU, "health", "limits", value={"gyro": [1]}), "E207", "`limits` of `gyro` is f64[2]", "[1]"),
    (edited(*IMU, "health", "tolerance", value={"gyro": 0}), "E204", "`tolerance` of `gyro` is 0", "0"),
    (edited(*IMU, "health", "limits", value={"delta_angle": [0, 1]}), "E506", "measures", '"delta_angle"'),
    # filters
    (edited(*IMU, "low_pass_hz", value={"gyro": 200.25}), "E514", "a low-pass of 200.25 Hz at the 400.5 Hz", "200.25"),
    (edited(*IMU, "low_pass_hz", value={"gyro": 0.09}), "E514", "too slow for the 1000 Hz of `imu_top`", "0.09"),
    (
        edited(*IMU, "notch", value={"accel": [{"hz": 190, "width_hz": 21}]}),
        "E514",
        "a notch from 179.5 to 200.5 Hz at the 400.5 Hz",
        '{"hz"',
    ),
    (
        edited(*IMU, "notch", value={"accel": [{"hz": 10, "width_hz": 20}]}),
        "E514",
        "a notch from 0 to 20 Hz is too slow",
        '{"hz"',
    ),
    (
        edited(*IMU, "notch", value={"accel": [{"hz": 50, "width_hz": 10}] * 7}),
        "E514",
        "9 filters in one sensor",
        '{"hz"',
    ),
    (
        edited("sensors", "battery", "low_pass_hz", value={"voltage": 1}),
        "E514",
        "a filter of `cells`, whose rate is unknown",
        "1",
    ),
    (edited("sensors", "rc", "low_pass_hz", value={"sticks": 1}), "E506", "can correct or filter", '"sticks"'),
    # outputs
    (edited(*OUT, "device", value="ecs"), "E206", "no device `ecs`", '"ecs"'),
    (edited(*OUT, "device", value="bmp"), "E518", "device `bmp` cannot have outputs", '"bmp"'),
    (edited("devices", "valve", value={"driver": "can", "device": "can0"}), "E518", "`valve` cannot have", '"valve"'),
    (edited(*OUT, "device", value="imu_far"), "E518", "device `imu_far` cannot have outputs", '"imu_far"'),
    (edited(*OUT, "device", value="cells"), "E518", "device `cells` cannot have outputs", '"cells"'),
    (edited("devices", "valve", "rate_hz", value=50), "E518", "device `valve` cannot have outputs", '"valve"'),
    (edited("sensors", "baro", "backends", 0, "device", value="esc"), "E518", "`esc` cannot be a backend", '"esc"'),
    (edited("outputs", "motor", value={"device": "esc", "elements": []}), "E206", "no channel `motor`", '"motor"'),
    (
        edited("outputs", "imu.gyro", value={"device": "esc", "elements": []}),
        "E515",
        "`imu.gyro` cannot be",
        '"imu.gyro"',
    ),
    (edited(*OUT, "elements", value=[]), "E515", "0 elements, and channel `motors` has 2", "[]"),
    (
        edited("outputs", "force", "elements", value=[{"signal": s, "output": [0, 1], "safe_output": 0} for s in "ab"]),
        "E515",
        "2 elements, and channel `force` has 1",
        "[",
    ),
    (edited("outputs", "force", "elements", value=[{}]), "E202", "an element has no `signal`", "{}"),
    (edited(*FIRST, "signal", value="pulse 0"), "E203", "`pulse 0` is not the name of a signal", '"pulse 0"'),
    (edited(*FIRST, "signal", value="p" * 65), "E505", "longer than 64 characters", '"ppp'),
    (edited("pace", "device", value="esc"), "E520", "device `esc` paces the loop, and no sensor uses it", '"esc"'),
    (edited("pace", "device", value="none"), "E206", "no device `none`", '"none"'),
    (edited("pace", "device", value="bmp"), "E520", "device `bmp` cannot pace the loop", '"bmp"'),
    (edited("pace", "device", value="imu_top"), "E520", "has 1000 samples a second, and the machine 100", '"imu_top"'),
    (edited("devices", "esc", "device", value="pwmchip0@600"), "E516", "a pulse of 2000 us, and `esc` has one", "{"),
    (edited("pace", "timeout_s", value=0), "E204", "`timeout_s` is 0", "0"),
    (edited(*FIRST, "signal", value="pulse1"), "E519", "signal `pulse1` of `esc` has two sources", '{"signal"'),
    (edited(*FIRST, "command", value=[1, 1]), "E516", "no command is between 1 and 1", "[1, 1]"),
    (edited(*FIRST, "command", value=[1, 0]), "E516", "no command is between 1 and 0", "[1, 0]"),
    (edited(*FIRST, "command", value=[0, 1, 2]), "E207", "`command` is f64[2]", "[0, 1, 2]"),
    (edited(*FIRST, "command", value=[0, 1.1e9]), "E204", "`command` is 1100000000.0", "11"),
    (edited(*FIRST, "output", value=[1000, 1000]), "E516", "the output is always 1000", "[1000"),
    (edited(*FIRST, "output", value=[1000, 999, 2000]), "E516", "the middle (999) is not between", "[1000"),
    (edited(*FIRST, "output", value=[2000, 2001, 1000]), "E516", "the middle (2001) is not between", "[2000"),
    (edited(*FIRST, "output", value=[1000]), "E207", "`output` is f64[2]", "[1000]"),
    (edited(*FIRST, "output", value=[1, 2, 3, 4]), "E207", "`output` is f64[2]", "[1, 2"),
    (edited(*FIRST, "output", value=1000), "E207", "`output` is f64[2]", "1000"),
    (edited(*FIRST, "output", value=[-2e9, 0]), "E204", "`output` is -2000000000.0", "-2"),
    (edited(*FIRST, "slew_per_s", value=-1), "E204", "`slew_per_s` is -1", "-1"),
    (edited(*FIRST, "safe_output", value=999), "E516", "`safe_output` (999) is not between 1000 and 2000", "999"),
    (edited(*FIRST, "safe_output", value=2000.5), "E516", "`safe_output` (2000.5) is not between", "2000.5"),
    (edited(*FIRST, "safe_output", value=0), "E516", "`slew_per_s` with a `safe_output` of 0", "0"),
    (
        edited("outputs", "force", "elements", 0, "safe_output", value=REMOVED),
        "E517",
        "element 0 of channel `force` has no safe value",
        '{"signal": "opening"',
    ),
    # warnings
    (edited("devices", "spare", value={"driver": "ubx", "device": "x"}), "W501", "nothing uses device", '"spare"'),
    (edited(*IMU, "channels", "accel", value=REMOVED), "W502", "no sensor feeds channel `imu.accel`", '"quad.json"'),
    (
        edited(*IMU, "low_pass_hz", value={"gyro": 80}),
        "W504",
        "`accel` of `imu_top` comes at 1000 Hz, and a tick at 100",
        '"imu.accel"',
    ),
    (
        edited("sensors", "baro", "health", value={"tolerance": {"pressure": 10}}),
        "W505",
        "`tolerance` of `pressure` has no effect",
        "10",
    ),
]


@pytest.mark.parametrize(("board", "code", "message", "at"), EDITS, ids=[f"{e[1]}-{e[2]}" for e in EDITS])
def test_diagnostics(board: Any, code: str, message: str, at: str, folder: Path) -> None:
    diagnostics = found(folder, board)
    assert {d.code for d in diagnostics} == {code}, "\n".join(d.render() for d in diagnostics)
    assert any(message in d.message for d in diagnostics), [d.message for d in diagnostics]
    assert all(place(d).startswith(at) for d in diagnostics), [place(d) for d in diagnostics]


@pytest.mark.parametrize(
    ("board", "help_text"),
    [
        (edited("devices", "bmp", "driver", value="ioo"), "did you mean `iio`?"),
        (edited("devices", "bmp", "driver", value="thing"), "there are iio, power_supply"),
        (edited(*IMU, "channels", "feld", value="imu.gyro"), "there are gyro, accel, temperature, delta_angle"),
        (edited(*TOP, "rotation", value="roll_180_yaw_80"), "angles are multiples of 45 from 45 to 315"),
    ],
)
def test_help(board: Any, help_text: str, folder: Path) -> None:
    (error,) = found(folder, board)
    assert help_text in error.help


def test_no_aliasing_of_integrals(folder: Path) -> None:
    """delta_angle alone needs no low-pass."""
    imu = {"kind": "inertial", "channels": {"delta_angle": "imu.angle"}, "backends": [{"device": "imu_top"}]}
    assert "W504" not in {d.code for d in found(folder, edited(*IMU, value=imu))}


@pytest.mark.parametrize(("rate_hz", "codes"), [(99, set()), (100, set()), (101, {"W504"})])
def test_aliasing_begins_above_the_rate_of_the_ticks(rate_hz: int, codes: set[str], folder: Path) -> None:
    board = edited(*IMU, value={"kind": "inertial", "channels": {"gyro": "imu.gyro"}, "backends": [{"device": "bmp"}]})
    board["devices"]["bmp"]["rate_hz"] = rate_hz
    del board["pace"]
    assert {d.code for d in found(folder, board)} - {"W501", "W502"} == codes


def test_a_channel_without_an_age_limit(folder: Path) -> None:
    channels = [dict(c) for c in MACHINE["channels"]]
    del channels[3]["max_age_ticks"]
    write_machine(folder, channels=channels)
    (warning,) = found(folder, BOARD)
    assert (warning.code, place(warning)) == ("W503", '"baro.pressure"')
    assert [n.span.source.name for n in warning.notes] == ["quad.json"]


def test_two_sensors_of_one_channel(folder: Path) -> None:
    second = {**BOARD["sensors"]["baro"], "backends": [{"device": "bmp"}]}
    (error,) = found(folder, edited("sensors", "second", value=second))
    assert error.code == "E508" and [place_of.text for place_of in error.notes] == ["the other"]


def test_a_channel_of_integers(folder: Path) -> None:
    channels = [*MACHINE["channels"], {**MACHINE["channels"][3], "name": "n", "id": 20, "field": "law.inputs.count"}]
    write_machine(folder, channels=channels)
    (error,) = found(folder, edited("sensors", "baro", "channels", "temperature", value="n"))
    assert error.code == "E507" and "the channel is i32" in error.message


def test_a_value_has_any_unit(folder: Path) -> None:
    value = {"kind": "value", "channels": {"value": "baro.pressure"}, "backends": [{"device": "bmp"}]}
    assert found(folder, edited("sensors", "baro", value=value)) == []


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
    assert "\nundriven force\nend\n" in plan_text(board)
    (error,) = found(folder, edited("outputs", "imu.gyro", value=None))
    assert error.code == "E515"
    channel = {"name": "ready", "id": 20, "field": "law.outputs.ready", "direction": "actuator"}
    write_machine(folder, channels=[*MACHINE["channels"], channel])
    assert check_board(write_board(folder, edited("outputs", "ready", value=None))).undriven == ("ready",)


@pytest.mark.parametrize("rest", [{}, {"sensors": {}}, {"outputs": {}}, {"sensors": {}, "outputs": {}}])
def test_a_board_for_nothing(rest: dict[str, Any], folder: Path) -> None:
    (error,) = found(folder, {"machine": "quad.json", "devices": {}, **rest})
    assert (error.code, error.message) == ("E202", "a board has no `sensors` and no `outputs`")


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


@pytest.mark.parametrize("driver", ["log", "pwm"])
def test_devices_of_actuators_have_no_period(driver: str, folder: Path) -> None:
    text = plan_text(check_board(write_board(folder, edited("devices", "esc", "driver", value=driver))))
    assert f"device esc 0 {driver} pwmchip0" in text


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
