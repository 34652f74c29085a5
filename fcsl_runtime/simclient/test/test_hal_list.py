# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal list` and `describe` on a fake sysfs."""

from __future__ import annotations

import json
import os
import pty
import struct
import tty
from dataclasses import astuple
from pathlib import Path

import pytest
from hal_rig import Iio, run, write_plan

from fcsl_compiler.board.drivers import ACTUATOR, known_drivers
from fcsl_compiler.board.filters import low_pass, notch
from simclient.hal.driver import any_driver

#: Drivers that are proposed for each serial port.
SERIAL = [name for name, driver in known_drivers().items() if driver.serial]


def write(folder: Path, **attributes: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in attributes.items():
        (folder / name).write_text(f"{text}\n")


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    """A computer with one device of each kind, and two IIO devices of one name."""
    root = tmp_path / "sys"
    imu = Iio(root, 0, "icm42688", anglvel=(0.1, 0.0, -0.1), accel=(0.0, 0.0, 9.8))
    write(imu.folder / "scan_elements", in_anglvel_x_index="0", in_timestamp_index="7")
    write(imu.folder, sampling_frequency="1000.000000")
    Iio(root, 1, "bmi088", accel=(0.0, 0.0, 9.8))
    write(Iio(root, 2, "bmi088", anglvel=(0.0, 0.0, 0.0)).folder, label="gyro_2")
    (root / "devices/i2c-1/1-0040").mkdir(parents=True)
    (root / "class/pwm/pwmchip0").mkdir(parents=True)
    (root / "class/pwm/pwmchip0/device").symlink_to("../../../devices/i2c-1/1-0040")
    write(root / "class/pwm/pwmchip0", npwm="16")
    write(root / "class/power_supply/BAT0", type="Battery", voltage_now="12000000", capacity="80")
    write(root / "class/power_supply/AC", type="Mains", online="1")
    write(root / "class/thermal/thermal_zone0", type="cpu-thermal", temp="45000")
    write(root / "class/input/event3/device", name="RadioMaster TX16S", uniq="", phys="usb-1/input0")
    write(root / "class/input/event3/device/capabilities", abs="ff")
    write(root / "class/input/event4/device", name="Power Button")
    write(root / "class/input/event4/device/capabilities", abs="0")
    write(root / "class/tty/ttyUSB0/device")
    write(root / "class/tty/ttyS9/device")
    write(root / "class/tty/ttyS9", type="0")
    write(root / "class/tty/tty1")
    write(root / "class/net/can0", type="280")
    write(root / "class/net/eth0", type="1")
    (root / "bus/gpio/devices/gpiochip0").mkdir(parents=True)
    write(root / "bus/iio/devices/iio:device3", name="ads1015", in_voltage2_raw="7")
    return root


def listed(sysfs: Path, dev: Path | None = None) -> dict[str, dict[str, object]]:
    found = json.loads(run(sysfs, "list", "--json", dev=dev).stdout)
    return {f"{one['kind']} {one['name']}": one for one in found}


def devices(one: dict[str, object]) -> list[tuple[str, str]]:
    candidates = one["candidates"]
    assert isinstance(candidates, list)
    return [(candidate["driver"], candidate["device"]) for candidate in candidates]


def test_each_kind_of_device_and_the_text_for_the_board(sysfs: Path) -> None:
    found = listed(sysfs)
    assert {name: devices(one) for name, one in found.items()} == {
        "IIO device icm42688": [("iio", "icm42688"), ("iio_buffer", "icm42688@1000")],
        "IIO device bmi088": [("iio", "iio:device1")],
        "IIO device bmi088 gyro_2": [("iio", "gyro_2")],
        "PWM chip pwmchip0": [("pwm", "1-0040")],
        "power supply AC (Mains)": [],
        "power supply BAT0 (Battery)": [("power_supply", "BAT0")],
        "thermal zone cpu-thermal": [("thermal", "cpu-thermal")],
        "input device RadioMaster TX16S": [("evdev", "RadioMaster TX16S")],
        "input device Power Button": [],
        "serial port ttyUSB0": [(name, f"{sysfs}/dev/ttyUSB0") for name in SERIAL],
        "CAN interface can0": [("can", "can0:1A0/16:12@1-*0.1")],
        "IIO device ads1015": [("iio", "ads1015"), ("adc", "ads1015")],
        "GPIO chip gpiochip0": [("gpio", "gpiochip0"), ("gpio_out", "gpiochip0")],
    }
    assert found["IIO device icm42688"]["measures"] == ["gyro", "accel"]
    assert found["power supply BAT0 (Battery)"]["measures"] == ["voltage", "charge"]
    assert found["input device RadioMaster TX16S"]["measures"] == ["sticks (8 axes)"]


def test_drivers_say_whether_they_would_take_it(sysfs: Path) -> None:
    ready = {
        name: [candidate["ready"] for candidate in one["candidates"]]  # type: ignore[attr-defined]
        for name, one in listed(sysfs).items()
    }
    for name in ("IIO device bmi088", "IIO device bmi088 gyro_2", "power supply BAT0 (Battery)", "PWM chip pwmchip0"):
        assert ready[name] == [True], name
    assert ready["IIO device icm42688"] == [True, True]
    assert not any(ready["CAN interface can0"] + ready["serial port ttyUSB0"] + ready["input device RadioMaster TX16S"])


def test_a_serial_port_by_its_id(sysfs: Path, tmp_path: Path) -> None:
    primary, secondary = pty.openpty()
    dev = tmp_path / "dev"
    (dev / "serial/by-id").mkdir(parents=True)
    (dev / "ttyUSB0").symlink_to(os.ttyname(secondary))
    (dev / "serial/by-id/usb-u-blox").symlink_to("../../ttyUSB0")
    one = listed(sysfs, dev)["serial port ttyUSB0"]
    assert devices(one)[0] == ("sbus", f"{dev}/serial/by-id/usb-u-blox")
    assert [candidate["ready"] for candidate in one["candidates"]] == [True] * len(SERIAL)  # type: ignore[attr-defined]
    os.close(primary)
    os.close(secondary)


def test_the_table(sysfs: Path) -> None:
    lines = run(sysfs, "list").stdout.splitlines()
    assert lines[0].split() == ["kind", "name", "driver", '"device"', "in", "board.json", "measures"]
    assert any("sbus or crsf or ubx or nmea" in line and "No such file" in line for line in lines)
    assert any(line.startswith("GPIO chip") and "gpio or gpio_out" in line for line in lines)


def test_a_computer_without_devices(tmp_path: Path) -> None:
    assert "no IIO device" in run(tmp_path, "list").stdout
    assert json.loads(run(tmp_path, "list", "--json").stdout) == []


def test_odd_files_of_sysfs(tmp_path: Path) -> None:
    """Texts that are no numbers, a pipe in the place of an attribute, bytes that are no text."""
    folder = tmp_path / "bus/iio/devices/iio:device0"
    write(folder, in_accel_x_raw="1", sampling_frequency="often")
    write(folder / "scan_elements", in_accel_x_index="?")
    (folder / "name").write_bytes(b"\xff\x1b[2J\n")
    os.mkfifo(folder / "label")
    write(tmp_path / "class/input/event0/device/capabilities", abs="none of these")
    write(tmp_path / "class/pwm/pwmchip0", npwm="")
    found = listed(tmp_path)
    assert len(found) == 3
    assert devices(found["IIO device \ufffd\ufffd[2J"])[1][1].endswith("@100")


# ---- describe --------------------------------------------------------------------------------------------------------


def test_describe_a_driver(tmp_path: Path) -> None:
    text = run(tmp_path, "describe", "iio").stdout
    assert text.startswith("iio (sensor, polled: it needs a rate_hz): ")
    assert "accel        f64[3]  m/s^2  specific force" in text
    assert "actuator" in run(tmp_path, "describe", "log").stdout


def test_describe_a_device(sysfs: Path) -> None:
    text = run(sysfs, "describe", "iio", "icm42688").stdout
    assert "gyro         f64[3]  rad/s  [0.1, 0, -0.1]" in text
    assert "pressure     f64     Pa     not told" in text
    told = json.loads(run(sysfs, "describe", "iio", "icm42688", "--json").stdout)
    assert told["values"]["accel"] == pytest.approx([0.0, 0.0, 9.8]) and told["values"]["pressure"] == ["nan"]
    assert not told["waits"] and told["why"] == ""


def test_a_device_that_cannot_be_opened(sysfs: Path) -> None:
    done = run(sysfs, "describe", "iio", "icm20602", status=1)
    assert "gyro" in done.stdout
    assert "no IIO device is called 'icm20602'; there are: " in done.stderr
    assert json.loads(run(sysfs, "describe", "iio", "icm20602", "--json", status=1).stdout)["values"] is None


def test_a_device_that_is_silent(tmp_path: Path) -> None:
    primary, secondary = pty.openpty()
    tty.setraw(secondary)
    done = run(tmp_path, "describe", "sbus", os.ttyname(secondary), "--seconds", "0.3", status=1)
    assert "gave no sample in 0.3 s" in done.stderr
    os.close(primary)
    os.close(secondary)


@pytest.mark.parametrize("name", ["log", "l"])
def test_an_actuator_is_not_opened(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(tmp_path, "describe", "log", name)
    assert "is there; an actuator is not opened" in done.stdout
    assert not (tmp_path / name).exists()


def test_describe_a_plan(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    text = run(tmp_path, "describe", plan).stdout
    for line in (
        "machine craft, 100 Hz",
        "  imu       iio   icm42688          200 Hz               inertial",
        "  receiver  sbus  /dev/no_receiver  sends when it likes  rc",
        "sensor inertial (inertial)",
        "  gyro → channel gyro",
        "     gyro: offset [9, 9, 9] rad/s",
        "     gyro: times [0, -1, 0], [1, 0, 0], [0, 0, 1]",
    ):
        assert line in text.splitlines(), text
    told = json.loads(run(tmp_path, "describe", plan, "--json").stdout)
    assert [sensor["name"] for sensor in told["sensors"]] == ["inertial", "compass", "rc"]


def test_describe_hardware(tmp_path: Path) -> None:
    plan = tmp_path / "panel.plan"
    lines = ["machine panel 100", "device buttons 5000000 gpio chip,pull_up", "device lamps 0 gpio_out chip"]
    lines += ["device cells 20000000 adc ads1015", "gpio_in 4 buttons line22", "gpio_out 17 lamps line17 0"]
    lines += ["gpio_out 18 lamps line18 1", "adc 0 cells counts2", "registers 4096 8 16 read_write /dev/my uio"]
    plan.write_text("\n".join(["fcsl-board-plan 1", *lines, "registers 64 4 0 read /dev/uio1", "end", ""]))
    text = run(tmp_path, "describe", plan).stdout.splitlines()
    assert text[text.index("hardware") + 1 :] == [
        "  hw_read_gpio(4): line22 of buttons",
        "  hw_write_gpio(17): line17 of lamps, off at the start and at the end",
        "  hw_write_gpio(18): line18 of lamps, on at the start and at the end",
        "  hw_read_adc(0): counts2 of cells",
        "  hw_read_u32 and hw_write_u32 from 0x1000 to 0x1004: /dev/my uio, from byte 16 on",
        "  hw_read_u32 from 0x40 to 0x40: /dev/uio1",
    ]
    assert [line.split()[-4:] for line in text if line.split()[:1] == ["lamps"]] == [["gpio", "17,", "gpio", "18"]]
    told = json.loads(run(tmp_path, "describe", plan, "--json").stdout)
    assert [pin["safe"] for pin in told["pins"]] == [None, False, True]


def bits(*values: float) -> str:
    return " ".join(struct.pack(">d", value).hex() for value in values)


def test_describe_every_line_of_a_sensor(tmp_path: Path) -> None:
    plan = tmp_path / "craft.plan"
    one, none = (1, 0, 0, 0, 1, 0, 0, 0, 1), (0, 0, 0)
    sections = [f"section gyro {bits(*astuple(s))}" for s in (low_pass(40, 200), notch(60, 10, 200))]
    lines = ["machine craft 100", "device imu 5000000 iio icm42688", "device air 0 i2c_air /dev/i2c-1"]
    lines += ["sensor inertial inertial", "health 200000000 50000000 1000000000", f"limits accel {bits(-160, 160)}"]
    lines += [f"tolerance gyro {bits(0.5)}", "bind gyro gyro", "backend imu", "signal gyro gyro", "signal accel accel"]
    lines += [f"correct gyro {bits(*one, 1, 2, 3, 0, 0, 0.5, 25)}", *sections]
    lines += [f"correct accel {bits(2, *one[1:], *none, *none, 0)}"]
    lines += ["sensor barometer barometer", "health 100000000 0 2000000000", "bind pressure pressure", "backend air"]
    lines += ["signal pressure pressure", f"correct pressure {bits(1.5, *one[1:], 20, 0, 0, 0.25, 0, 0, 15)}"]
    lines += [f"section pressure {bits(*astuple(low_pass(10, 200)))}", "backend imu", "signal pressure temperature"]
    lines += [f"correct pressure {bits(*one, *none, *none, 0)}"]
    plan.write_text("\n".join(["fcsl-board-plan 1", *lines, "end", ""]))
    text = run(tmp_path, "describe", plan).stdout.splitlines()
    assert text[text.index("sensor inertial (inertial)") :] == [
        "sensor inertial (inertial)",
        "  gyro → channel gyro",
        "  healthy: a reading younger than 0.2 s, not the same for 0.05 s; one that failed counts again after 1 s",
        "  accel between -160 and 160 m/s^2",
        "  gyro within 0.5 rad/s of the other devices",
        "  1. imu",
        "     gyro: its signal gyro",
        "     accel: its signal accel",
        "     gyro: offset [1, 2, 3] rad/s",
        "     gyro: offset changes by [0, 0, 0.5] rad/s per kelvin above 25 degC",
        "     accel: times [2, 0, 0], [0, 1, 0], [0, 0, 1]",
        "     gyro: low-pass at 40 Hz",
        "     gyro: notch at 60 Hz",
        "",
        "sensor barometer (barometer)",
        "  pressure → channel pressure",
        "  healthy: a reading younger than 0.1 s; one that failed counts again after 2 s",
        "  1. air",
        "     pressure: its signal pressure",
        "     pressure: offset 20 Pa",
        "     pressure: offset changes by 0.25 Pa per kelvin above 15 degC",
        "     pressure: times 1.5",
        "     pressure: low-pass",
        "  2. imu",
        "     pressure: its signal temperature",
    ]


def test_describe_outputs_and_sticks(tmp_path: Path) -> None:
    plan = tmp_path / "craft.plan"
    lines = ["machine craft 100", "device receiver 0 sbus /dev/ttyS0", "device escs 0 pwm pwmchip0"]
    lines += ["sensor rc rc", "health 100000000 0 1000000000", "bind sticks sticks", "backend receiver"]
    lines += ["signal sticks sticks", f"stick 0 {bits(1000, 1500, 2000, 0)}", f"stick 3 {bits(990, 1490, 2010, 8)}"]
    lines += ["output motors escs", f"pulse 0 us0 {bits(0, 1, 1000, 1500, 2000, 0, 900)}"]
    lines += [f"pulse 2 us3 {bits(-1, 1, 1100, 1500, 1900, 2, 1500)}"]
    plan.write_text("\n".join(["fcsl-board-plan 1", *lines, "end", ""]))
    text = run(tmp_path, "describe", plan).stdout.splitlines()
    assert [line for line in text if "stick " in line] == [
        "     stick 0: 1000, 1500, 2000 us become -1, 0, 1",
        "     stick 3: 990, 1490, 2010 us become -1, 0, 1, 8 us on both sides of the middle are 0",
    ]
    assert text[text.index("output motors → escs") :] == [
        "output motors → escs",
        "  motors[0] → us0: 0, 0.5, 1 become 1000, 1500, 2000; safe: 900",
        "  motors[2] → us3: -1, 0, 1 become 1100, 1500, 1900, at most 2 per second; safe: 1500",
    ]
    assert [line.split() for line in text if "pwmchip0" in line] == [["escs", "pwm", "pwmchip0", "actuator", "motors"]]


def test_signals_of_drivers_are_those_that_the_compiler_knows() -> None:
    """An output needs a signal that is one f64."""
    for name, known in known_drivers().items():
        signals = [s for s in any_driver(name).signals if known.kind != ACTUATOR or s.type_text == "f64"]
        assert tuple(s.name for s in signals) == known.signals, name


def test_describe_what_paces_and_what_is_not_driven(tmp_path: Path) -> None:
    plan = tmp_path / "small.plan"
    lines = ["machine craft 100", "device imu 0 iio_buffer bmi088", "device spare 0 log /tmp/log", "pace imu 250000000"]
    lines += ["sensor inertial inertial", "health 100000000 0 1000000000", "bind gyro gyro", "backend imu"]
    plan.write_text("\n".join(["fcsl-board-plan 1", *lines, "signal gyro gyro", "undriven valve", "end", ""]))
    text = run(tmp_path, "describe", plan).stdout.splitlines()
    assert text[0] == "machine craft, 100 Hz, its ticks are the samples of imu"
    assert text[1] == "the flight ends when imu is silent for 0.25 s"
    assert text[-1] == "nothing drives valve"
    assert any(line.split() == ["spare", "log", "/tmp/log", "-", "not", "used"] for line in text)
    told = json.loads(run(tmp_path, "describe", plan, "--json").stdout)
    assert (told["pace"], told["pace_timeout_ns"], told["undriven"]) == ("imu", 250000000, ["valve"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["describe", "nothing"], "no driver 'nothing'"),
        (["describe", "./nothing.so:x", "y"], "nothing.so"),
        (["describe", "nothing.plan"], "nothing.plan"),
        (["describe", "iio", "x", "--seconds", "0"], "seconds wanted"),
        (["describe", "cut.plan"], "cut.plan"),
        (["describe", "odd.plan"], "odd.plan"),
        (["describe", "pipe.plan"], "pipe.plan"),
        (["describe", "\udcff.plan"], "cannot read"),
        (["monitor", "odd.plan"], "odd.plan"),
        (["list", "more"], "unrecognized"),
        (["describe"], "required"),
        ([], "required"),
    ],
)
def test_wrong_usage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], says: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cut.plan").write_text("fcsl-board-plan 1\nmachine craft 100\n")
    Path("odd.plan").write_bytes(b"\xff\x00\xfe")
    os.mkfifo("pipe.plan")
    assert says in run(tmp_path, *words, status=2).stderr
