# SPDX-License-Identifier: Apache-2.0
"""Hardware of a machine: simulated for a twin, a board's for fcsl-fc; and impure instances replay from their record."""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from native import PROGRAM, flying
from rosbags.highlevel import AnyReader
from test_simclient_replay import edited

from fcsl_compiler.api.build import build_machine
from simclient import AlgTwin, ProcessTwin, Twin, TwinError
from simclient.replay import replay
from simclient.run import open_run


def build_board(folder: Path) -> Path:
    """The library of test/machines/board.c."""
    library = folder / "libboard.so"
    include = ROOT / "fcsl_compiler/include"
    subprocess.run(["cc", *CFLAGS, f"-I{include}", str(MACHINES / "board.c"), "-o", str(library)], check=True)
    return library


MACHINES = ROOT / "fcsl_runtime/simclient/test/machines"
#: Registers of the bench: what it reads and what it writes.
TURNS, DUTY = 0x40000024, 0xFFFFFFFF


@pytest.fixture(scope="module")
def bench() -> Path:
    """Its instance `io` reads hardware in every second tick; `law` computes from what it read."""
    return build_machine(MACHINES / "bench.json").library


def fly(twin: Twin, ticks: int = 40) -> list[float]:
    """Readings that change, among them some that make `io` fault; returns law.outputs.out after every tick."""
    outs = []
    for k in range(ticks):
        twin.hardware.adc[3] = 2500 if 10 <= k < 14 else round(800 * (1 + math.sin(k)))
        twin.hardware.registers[TURNS] = k * k
        twin.hardware.gpio[4] = k % 3 == 0
        if k == 20:
            twin.set_state("RUN")
        twin.tick()
        outs.append(twin.get_value("law.outputs.out"))
    return outs


@pytest.fixture(params=[AlgTwin, ProcessTwin], ids=["in process", "process"])
def open_bench(request: pytest.FixtureRequest, bench: Path) -> Iterator[Callable[[], Twin]]:
    """Opens twins of the bench, in this process and in another one."""
    with contextlib.ExitStack() as opened:
        yield lambda: opened.enter_context(request.param.from_library(bench))


# ---- a twin -----------------------------------------------------------------------------------------------------------


def test_readings_go_in_and_writes_come_out(open_bench: Callable[[], Twin]) -> None:
    with open_bench() as twin:
        hardware = twin.hardware
        assert not hardware.gpio[17] and hardware.registers[DUTY] == 0 and hardware.adc[1023] == 0
        hardware.adc[3] = 1250
        hardware.registers[TURNS] = 2**32 - 1
        hardware.gpio[4] = True
        twin.tick()
        assert hardware.gpio[17] is False  # io runs in odd ticks
        twin.tick()
        assert hardware.gpio[17] is True and hardware.registers[DUTY] == 625 and hardware.failures == 0
        assert twin.get_value("io.outputs.volts") == 1.25 and twin.get_value("io.outputs.level") is True
        assert twin.get_value("io.state.turns") == 2**32 - 1


def test_a_refused_access_is_counted_and_the_step_goes_on(open_bench: Callable[[], Twin]) -> None:
    with open_bench() as twin:
        twin.hardware.adc[3] = 1500
        twin.tick(2)
        assert twin.hardware.failures == 0
        for failures, pin in enumerate((1024, 2**32 - 1), 1):
            twin.set("io.parameters.led_pin", pin)
            twin.tick(2)
            assert twin.hardware.failures == failures
        assert twin.get_value("io.outputs.volts") == 1.5 and twin.hardware.registers[DUTY] == 750


def test_registers_keep_what_was_written_last(open_bench: Callable[[], Twin]) -> None:
    with open_bench() as twin:
        registers, expected, rng = twin.hardware.registers, dict[int, int](), random.Random(3)
        for _ in range(100):
            address, value = rng.choice([*range(8), TURNS, DUTY]), rng.choice([0, 1, 2**32 - 1])
            registers[address] = expected[address] = value
            assert {a: registers[a] for a in expected} == expected
        twin.hardware.adc[3] = 1000
        registers[DUTY] = 7
        twin.tick(2)
        assert registers[DUTY] == 500  # the machine has written it
        registers[DUTY] = 8
        assert registers[DUTY] == 8


def test_registers_have_an_end(bench: Path) -> None:
    """1024 values at a time; a register that is 0 again makes room."""
    with AlgTwin.from_library(bench) as twin, ProcessTwin.from_library(bench) as process:
        for address in range(1024):
            twin.hardware.registers[4 * address] = address + 1
        process.restore(twin.save())
        for full in (twin, process):
            with pytest.raises(TwinError, match="simulated hardware is full: 1024 registers have a value already"):
                full.hardware.registers[5] = 1
            full.hardware.registers[5] = 0
            full.hardware.adc[3] = 500
            full.tick(2)
            assert full.hardware.failures == 1 and full.hardware.registers[DUTY] == 0
            full.hardware.registers[8] = 0
            full.tick(2)
            assert full.hardware.failures == 1 and full.hardware.registers[DUTY] == 250
        assert twin.save() == process.save()


def test_two_twins_have_their_own_hardware(open_bench: Callable[[], Twin]) -> None:
    with open_bench() as one, open_bench() as other:
        one.hardware.adc[3] = 1500
        one.tick(2)
        other.tick(2)
        assert one.hardware.gpio[17] and not other.hardware.gpio[17]
        assert other.get_value("io.outputs.volts") == 0.0


def test_wrong_numbers_and_values_are_refused(open_bench: Callable[[], Twin]) -> None:
    with open_bench() as twin:
        with pytest.raises(TwinError, match=r"hardware.gpio\[1024\]: simulated ones are numbered 0 to 1023"):
            twin.hardware.gpio[1024] = True
        with pytest.raises(TwinError, match=r"hardware.adc\[-1\]"):
            _ = twin.hardware.adc[-1]
        with pytest.raises(TwinError, match=r"hardware.gpio\[1\]: bool wanted, got 1"):
            twin.hardware.gpio[1] = 1
        for wrong in (True, 1.0):
            with pytest.raises(TwinError, match=rf"hardware.adc\[1\]: int wanted, got {wrong}"):
                twin.hardware.adc[1] = wrong
        for value in (-1, 2**32):
            with pytest.raises(TwinError, match=rf"hardware.registers\[1\]: {value} is out of the range of u32"):
                twin.hardware.registers[1] = value
        with pytest.raises(TwinError, match=r"hardware.registers\[4294967296\]: .* numbered 0 to 4294967295"):
            _ = twin.hardware.registers[2**32]
        twin.close()
        with pytest.raises(TwinError, match="closed"):
            _ = twin.hardware.adc[0]


def test_both_twins_fly_the_same_flight(bench: Path) -> None:
    with AlgTwin.from_library(bench) as one, ProcessTwin.from_library(bench) as other:
        assert fly(one) == fly(other) and one.snapshot() == other.snapshot()
        for number in range(24):
            for bank in ("gpio", "adc", "registers"):
                assert getattr(one.hardware, bank)[number] == getattr(other.hardware, bank)[number]
        for address in (TURNS, DUTY):
            assert one.hardware.registers[address] == other.hardware.registers[address] > 0


def test_a_checkpoint_of_a_process_holds_its_board(bench: Path) -> None:
    with AlgTwin.from_library(bench) as one, ProcessTwin.from_library(bench) as other:
        other.hardware.adc[3], other.hardware.registers[1023], other.hardware.gpio[4] = 750, 7, True
        other.tick(3)
        saved = other.save()
        expected = fly(other)
        one.restore(saved)
        assert one.hardware.registers[1023] == 7 and one.hardware.adc[3] == 750 and one.save() == saved
        assert fly(one) == expected
        other.restore(saved)
        assert other.hardware.adc[3] == 750 and other.save() == saved and fly(other) == expected


# ---- over the socket --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("members", "message", "hint"),
    [
        ({"bank": "gpoi", "number": 1}, "no hardware is called 'gpoi'", "gpio"),
        ({"bank": "gpio", "number": 1024}, "numbered 0 to 1023", ""),
        ({"bank": "gpio", "number": -1}, '"number": out of the range of u32', ""),
        ({"bank": "gpio", "number": "1"}, '"number": expected an integer', ""),
        ({"bank": "gpio"}, '"number": it is missing', ""),
        ({"bank": "gpio", "number": 1, "value": 1}, '"value": expected true or false', ""),
        ({"bank": "adc", "number": 1024, "value": 1}, "numbered 0 to 1023", ""),
        ({"bank": "adc", "number": 1, "value": [1]}, '"value": expected an integer', ""),
        ({"bank": "adc", "number": 1, "value": -1}, '"value": out of the range of u32', ""),
        ({"bank": "register", "number": 1}, "no hardware is called 'register'", "registers"),
        ({"bank": "registers", "number": 2**32}, '"number": out of the range of u32', ""),
        ({"bank": "registers", "number": 1, "value": 1.5}, '"value": expected an integer', ""),
        ({"bank": "registers", "number": 1, "value": 2**32}, '"value": out of the range of u32', ""),
    ],
)
def test_what_the_command_refuses(
    bench: Path, tmp_path: Path, members: dict[str, object], message: str, hint: str
) -> None:
    with flying("--socket", tmp_path / "s", "--paused", library=str(bench)) as fc:
        client = fc.client(tmp_path / "s")
        client.send(json.dumps({"cmd": "hardware", **members}).encode() + b"\n")
        error = client.read()["error"]
        assert error["code"] == "bad_value" and message in error["message"] and error["hint"] == hint
        for bank, nothing in (("gpio", False), ("adc", 0), ("registers", 0)):
            reply = client.ok("hardware", bank=bank, number=1)
            assert (reply["value"], reply["failures"]) == (nothing, 0)


def test_a_board_is_not_simulated(bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSL_TEST_BOARD", str(tmp_path / "board.txt"))
    board = build_board(tmp_path)
    with flying("--socket", tmp_path / "s", "--paused", "--board", board, library=str(bench)) as fc:
        error = fc.client(tmp_path / "s").error("hardware", bank="gpio", number=1)
        assert error["code"] == "refused" and "hardware of a board" in error["message"]


# ---- record and replay ------------------------------------------------------------------------------------------------


def test_an_impure_instance_replays_from_its_record(bench: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(bench) as twin:
        fly(twin, 7)
        twin.record(tmp_path / "run")
        outs = fly(twin)
        assert twin.get_value("io.counters.faults") == 2 and len(set(outs)) > 15
    verdict = replay(tmp_path / "run", library=str(bench))
    assert verdict.identical and verdict.ticks == 40, str(verdict)
    assert verdict.notes == [
        "outputs of `io` come from the record: it reads hardware or calls externs, and was not run"
    ]


def test_a_record_without_what_it_left_diverges(bench: Path, tmp_path: Path) -> None:
    """The substitute is what makes a replay identical: applied to no tick, the reading is 0 V and law shows it."""
    with AlgTwin.from_library(bench) as twin:
        twin.record(tmp_path / "run")
        expected = fly(twin)
    run = open_run(bench, None)
    with AnyReader([tmp_path / "run"]) as reader:
        writes = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/bench/record/writes"
        ]
    impure = [w for w in writes if w.kind == 6]
    assert [w.tick for w in impure] == list(range(1, 40, 2)) and {w.path for w in impure} == {"io"}
    out = run.machine.fields["law.outputs.out"]
    run.step(40)
    assert run.read(out.offset, out.size) == bytes(8)
    run.close()
    run = open_run(bench, None)
    for write in impure:
        run.step(write.tick - run.tick)
        run.substitute(0, bytes(write.data))
    run.step(40 - run.tick)
    assert memoryview(run.read(out.offset, out.size)).cast("d")[0] == expected[-1]
    assert run.hardware_failures() == 0 and not run.hardware().gpio[17]  # a replay drives no hardware
    run.close()


def test_a_bag_that_lacks_them_is_incomplete(bench: Path, tmp_path: Path) -> None:
    """Where what it left happens to be what it does anyway, the outputs agree; the verdict still says what is missing."""
    with AlgTwin.from_library(bench) as twin:
        twin.record(tmp_path / "run")
        twin.tick(10)

    def lose(topic: str, number: int, data: bytes) -> bytes | None:  # the third of the five times that io executed
        return None if topic == "/bench/record/writes" and number == 2 else data

    verdict = replay(edited(tmp_path / "run", tmp_path / "damaged", lose), library=str(bench))
    assert verdict.divergence is None and not verdict.identical
    assert verdict.missing == ["what `io` left in 1 executes is not in the bag: they ran again, on simulated hardware"]


def test_substitutes_are_checked(bench: Path) -> None:
    run = open_run(bench, None)
    with pytest.raises(TwinError, match="instance number 1 neither reads hardware nor calls externs"):
        run.substitute(1, bytes(8))
    with pytest.raises(TwinError, match="what instance 'io' leaves has 45 bytes, not 8"):
        run.substitute(0, bytes(8))
    with pytest.raises(TwinError, match="'io.outputs.level' cannot hold this value"):
        run.substitute(0, bytes(8) + b"\x02" + bytes(36))
    run.substitute(0, b"\x07" + bytes(44))
    run.step(1)  # io is not due: nothing is kept for later
    run.step(1)
    volts = run.machine.fields["io.outputs.volts"]
    assert run.read(volts.offset, volts.size) == bytes(8)
    run.close()


# ---- a board ----------------------------------------------------------------------------------------------------------


def fc(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [PROGRAM, *map(str, arguments)]
    env = os.environ | environment
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=env)


def test_fcsl_fc_flies_on_a_board(bench: Path, tmp_path: Path) -> None:
    board = build_board(tmp_path)
    log = tmp_path / "board.txt"
    arguments = (bench, "--board", board, "--ticks", "6", "--rate", "max", "--record", tmp_path / "run")
    done = fc(*arguments, FCSL_TEST_BOARD=str(log))
    assert (done.returncode, done.stderr) == (0, "") and f"fcsl-fc: board {board}\n" in done.stdout
    # Three executes: the LED and a register are driven, the pin and the register to read are missing.
    assert log.read_text() == "17 1\n0xffffffff 750\n" * 3 + "safe\n"
    assert ", 6 hardware failures," in done.stdout
    verdict = replay(tmp_path / "run", library=str(bench))
    assert verdict.identical and verdict.ticks == 6


def test_boards_that_cannot_be_used(bench: Path, tmp_path: Path) -> None:
    board = build_board(tmp_path)
    for library, status, reason in (
        (board, 1, f"fcsl-fc: board '{board}': no GPIO chip\n"),
        (bench, 1, f"fcsl-fc: '{bench}' is not a board library: it lacks fcsl_board_open or fcsl_board_close\n"),
        (tmp_path / "absent.so", 2, "fcsl-fc: cannot load board library: "),
    ):
        done = fc(bench, "--board", library, "--ticks", "6", FCSL_TEST_BOARD=str(tmp_path / "no/such/folder"))
        assert done.returncode == status and done.stderr.startswith(reason) and done.stderr.count("\n") == 1
        assert "6 ticks" not in done.stdout
