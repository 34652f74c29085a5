# SPDX-License-Identifier: Apache-2.0
"""What `fcsl board` reports, and where."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_boards import (
    BOARD,
    FIRST,
    IMU,
    MACHINE,
    OUT,
    REMOVED,
    TOP,
    edited,
    found,
    place,
    write_machine,
)

#: Places of hardware, and what may stand there.
PINS, ADC, WINDOWS = ("hardware", "gpio"), ("hardware", "adc"), ("hardware", "registers")
PIN = {"device": "panel", "signal": "line1"}
WINDOW = {"file": "/dev/uio1", "bytes": 8}


def log_output(signal: str) -> Any:
    """BOARD whose first motor goes to this signal of `log`, the other one nowhere else."""
    board = edited("devices", "esc", value={"driver": "log", "device": "/tmp/log"})
    for element, name in zip(board["outputs"]["motors"]["elements"], (signal, "number"), strict=True):
        element["signal"] = name
    return board


def two_names_of_a_chip() -> Any:
    """BOARD whose devices `lamps` and `more` are the same."""
    board = edited("devices", "more", value=BOARD["devices"]["lamps"])
    board["hardware"]["gpio"]["18"] |= {"device": "more", "signal": "line17"}
    return board


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_machine(tmp_path)
    return tmp_path


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
        edited("devices", value=BOARD["devices"] | {f"d{i}": BOARD["devices"]["bmp"] for i in range(22)}),
        "E505",
        "33 devices",
        "{",
    ),
    # signals of drivers
    (edited(*TOP, "signals", value={"gyro": "anglvel"}), "E521", "`iio_buffer` has no signal `anglvel`", '"anglvel"'),
    (edited(*FIRST, "signal", value="pulse16"), "E521", "driver `pwm` has no signal `pulse16`", '"pulse16"'),
    (log_output("three"), "E521", "driver `log` has no signal `three`", '"three"'),
    (edited(*PINS, "4", "signal", value="line64"), "E521", "driver `gpio` has no signal `line64`", '"line64"'),
    (edited(*ADC, "0", "signal", value="voltage3"), "E521", "driver `adc` has no signal `voltage3`", '"voltage3"'),
    # hardware
    (edited("hardware", value=[]), "E208", "`hardware` is an object", "[]"),
    (edited("hardware", "gpios", value={}), "E201", "unknown key `gpios` in `hardware`", '"gpios"'),
    (edited(*PINS, value=[]), "E208", "`gpio` is an object", "[]"),
    (edited(*PINS, "04", value=PIN), "E203", "`04` is no number", '"04"'),
    (edited(*PINS, "-1", value=PIN), "E203", "`-1` is no number", '"-1"'),
    (edited(*PINS, "0x4", value=PIN), "E203", "`0x4` is no number", '"0x4"'),
    (edited(*PINS, "4294967296", value=PIN), "E203", "`4294967296` is no number", '"4294967296"'),
    (edited(*PINS, value={str(i): PIN for i in range(65)}), "E505", "65 pins", "{"),
    (edited(*PINS, "4", "device", value="panle"), "E206", "no device `panle`", '"panle"'),
    (edited(*PINS, "4", "safe", value=True), "E518", "device `panel` cannot be driven here", '"panel"'),
    (edited(*PINS, "17", "safe", value=REMOVED), "E518", "device `lamps` cannot be read here", '"lamps"'),
    (edited(*PINS, "17", "safe", value=0), "E208", "`safe` is", "0"),
    (edited(*PINS, "18", "signal", value="line17"), "E519", "signal `line17` of `lamps` has two", '"line17"'),
    (edited(*PINS, "18", "device", value="esc"), "E518", "device `esc` cannot be driven here", '"esc"'),
    (edited(*PINS, "18", "device", value="cells"), "E518", "device `cells` cannot be driven here", '"cells"'),
    (edited(*ADC, "0", "device", value="lamps"), "E518", "device `lamps` cannot be read here", '"lamps"'),
    (edited(*ADC, "0", "safe", value=False), "E201", "unknown key `safe`", '"safe"'),
    (
        edited(*PINS, "4", value={"device": "imu_side", "signal": "voltage0"}),
        "E518",
        "`imu_side` cannot be read",
        '"imu',
    ),
    (
        edited(*ADC, "0", value={"device": "imu_side", "signal": "voltage0"}),
        "E518",
        "`imu_side` cannot be read",
        '"imu',
    ),
    (edited(*ADC, "0", value={"device": "panel", "signal": "line1"}), "E518", "`panel` cannot be read", '"panel"'),
    (two_names_of_a_chip(), "E519", "signal `line17` of `more` has two sources", '"line17"'),
    (edited("hardware", value={"gpio": 4}), "E208", "`gpio` is an object", "4"),
    (edited(*WINDOWS, "0x10000000g", value=WINDOW), "E203", "is no number", '"0x10000000g"'),
    (edited(*WINDOWS, "16", "bytes", value=6), "E522", "`bytes` is 6, no multiple of 4", "6"),
    (edited(*WINDOWS, "16", "bytes", value=0), "E204", "`bytes` is 0", "0"),
    (edited(*WINDOWS, "16", "offset", value=2), "E522", "`offset` is 2, no multiple of 4", "2"),
    (edited(*WINDOWS, "18", value=WINDOW), "E522", "no registers are at 18", '"18"'),
    (edited(*WINDOWS, "4294967292", value=WINDOW), "E522", "no registers are at 4294967292", '"4294967292"'),
    (edited(*WINDOWS, "0x14", value=WINDOW), "E522", "two windows have the same registers", '"0x14"'),
    (edited(*WINDOWS, "16", "file", value=""), "E505", "`file` is empty", '""'),
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


def test_hardware_that_the_machine_needs(folder: Path) -> None:
    """Each builtin that an algorithm calls needs its part of `hardware`."""
    calls = (
        "level = hw_read_gpio(5)",
        "hw_write_gpio(4, level)",
        "counts = hw_read_adc(0)",
        "self.steps[1] = i32(counts)",
    )
    source = (folder / "law.py").read_text().rstrip()
    (folder / "law.py").write_text("\n        ".join([source, *calls]) + "\n")
    assert not [d for d in found(folder, BOARD) if d.code == "W507"]
    warnings = found(folder, edited("hardware", value=REMOVED))
    assert [d.message for d in warnings if d.code == "W507"] == [
        "algorithm `Law` calls hw_read_adc, and the board has no `adc`",
        "algorithm `Law` calls hw_read_gpio, and the board has no pins",
        "algorithm `Law` calls hw_write_gpio, and the board has no pins with `safe`",
    ]
    board = edited("hardware", value={"gpio": {"4": PIN}})
    assert [d.why for d in found(folder, board) if d.code == "W507"] == ["it reads false or 0, and writes nothing"] * 2
    only_outputs = {k: v for k, v in BOARD.items() if k in ("machine", "devices", "outputs")}
    assert not [d for d in found(folder, only_outputs) if d.code == "W507"]  # fcsl-guard's board
