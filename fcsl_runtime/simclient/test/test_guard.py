# SPDX-License-Identifier: Apache-2.0
"""fcsl-guard: what the actuators get, whatever becomes of the flight program. docs/hardware/arming.md names these tests."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import ROOT
from guarding import COMMAND, PATIENCE_S, SAFE, TIMEOUT_S, Guard, Slot, command, guarding, wait_for
from native import Client, Fc, flying

BuildGuarded = Callable[..., Path]


@pytest.fixture
def library(build_guarded: BuildGuarded) -> Path:
    return build_guarded()


@pytest.fixture
def guard(library: Path, tmp_path: Path) -> Iterator[Guard]:
    with guarding(library, tmp_path) as guard:
        yield guard


@contextlib.contextmanager
def armed_flight(guard: Guard, library: Path, folder: Path, name: str = "fc") -> Iterator[tuple[Fc, Client]]:
    """A flight program whose commands the actuators have."""
    path = folder / name
    with flying("--guard", guard.slot, "--socket", path, library=str(library)) as fc:
        client = fc.client(path)
        client.set("pilot.outputs.force", COMMAND["number"])
        client.set("pilot.outputs.armed", True)
        guard.wait_last(COMMAND)
        yield fc, client
        client.close()


def test_commands_go_through_while_armed(guard: Guard, library: Path, tmp_path: Path) -> None:
    assert guard.last() == SAFE
    with armed_flight(guard, library, tmp_path) as (fc, client):
        guard.wait_line("armed, at tick")
        before = [write.values for write in guard.writes()]
        assert before[0] == SAFE and all(values in (SAFE, COMMAND) for values in before)
        client.set("pilot.outputs.valve", True)
        guard.wait_last({**COMMAND, "flag": 1.0})
        client.set("pilot.outputs.armed", False)
        guard.wait_last(SAFE)
        guard.stays_safe()
        guard.wait_line("disarmed")
        assert guard.told(f"process {fc.process.pid} has the slot")
        code, out, err = fc.stop()
        assert (code, err) == (0, "") and f"actuators by the guard at {guard.slot}" in out
        assert "fcsl-fc: guard: there to the end\n" in out
    guard.wait_line("has left the slot")


def test_stop_and_continue(guard: Guard, library: Path, tmp_path: Path) -> None:
    """A stopped program keeps the slot; when it goes on, so do its commands."""
    with armed_flight(guard, library, tmp_path) as (fc, _):
        fc.process.send_signal(signal.SIGSTOP)
        guard.wait_last(SAFE)
        guard.stays_safe()
        with flying("--guard", guard.slot, library=str(library)) as second:
            code, _, err = second.wait()
            assert code == 1 and f"refused: process {fc.process.pid} has its slot" in err
        guard.wait_line("turned away a process")
        fc.process.send_signal(signal.SIGCONT)
        guard.wait_last(COMMAND)


def test_a_step_that_hangs(guard: Guard, library: Path, tmp_path: Path) -> None:
    """Its process lives, and its other threads answer; only the step thread commands."""
    with armed_flight(guard, library, tmp_path) as (fc, client):
        client.set("pilot.state.hang", True)
        guard.wait_last(SAFE)
        guard.stays_safe()
        assert fc.process.poll() is None and client.get("pilot.outputs.armed") is True


def test_stop_in_the_middle_of_a_step(guard: Guard, library: Path, tmp_path: Path) -> None:
    """Its command comes after SIGCONT, and is as old as the sensors that it was computed from."""
    with armed_flight(guard, library, tmp_path) as (fc, client):
        values = {"pilot.outputs.force": -77.0, "pilot.state.stop": True}
        client.send(json.dumps({"cmd": "set", "values": values}).encode() + b"\n")  # its reply may come after SIGCONT
        os.waitid(os.P_PID, fc.process.pid, os.WSTOPPED | os.WNOWAIT)
        time.sleep(TIMEOUT_S)  # the age that the guard has to notice
        guard.wait_last(SAFE)
        fc.process.send_signal(signal.SIGCONT)
        assert client.read()["ok"]
        wait_for(lambda: client.get("pilot.state.hang"))  # published after the command was written
        guard.stays_safe()
        assert -77.0 not in {write.values["number"] for write in guard.writes()}


def test_a_pause(guard: Guard, library: Path, tmp_path: Path) -> None:
    with armed_flight(guard, library, tmp_path) as (_, client):
        client.ok("pause")
        guard.wait_last(SAFE)
        guard.stays_safe()
        client.ok("resume")
        guard.wait_last(COMMAND)


def test_restart_under_a_living_guard(guard: Guard, library: Path, tmp_path: Path) -> None:
    with armed_flight(guard, library, tmp_path) as (fc, _):
        fc.process.kill()
        fc.process.wait()
        guard.wait_line(f"process {fc.process.pid} has left the slot")
    guard.wait_last(SAFE)
    with armed_flight(guard, library, tmp_path, "again"):
        pass
    assert guard.process.poll() is None


REQUIRED = "armed in the checkpoint: actuators stay safe until the machine disarms and arms anew"


def arms_anew(guard: Guard, client: Client) -> None:
    """What is restored arms nothing, however long; the machine itself goes on as armed."""
    guard.stays_safe()
    assert client.get("pilot.outputs.armed") is True
    client.set("pilot.outputs.armed", False)
    tick = client.ok("state")["tick"]
    wait_for(lambda: client.ok("state")["tick"] > tick + 1)
    guard.stays_safe()
    client.set("pilot.outputs.armed", True)
    guard.wait_last(COMMAND)


def test_a_program_that_begins_with_an_armed_checkpoint(guard: Guard, library: Path, tmp_path: Path) -> None:
    with armed_flight(guard, library, tmp_path, "first") as (_, client):
        saved = base64.b64decode(client.ok("save")["data"])
    (tmp_path / "armed").write_bytes(saved)
    guard.wait_last(SAFE)
    before = guard.writes()[-1].time_s
    path = tmp_path / "second"
    with flying("--restore", tmp_path / "armed", "--guard", guard.slot, "--socket", path, library=str(library)) as fc:
        client = fc.client(path)
        arms_anew(guard, client)
        client.close()
        code, out, _ = fc.stop()
    assert code == 0 and REQUIRED in out
    after = [write.values for write in guard.writes() if write.time_s > before]
    assert after.index(COMMAND) > 20  # the safe values of `arms_anew` came first


def test_a_client_that_restores_an_armed_checkpoint(guard: Guard, library: Path, tmp_path: Path) -> None:
    """Into a disarmed flight it arms nothing; an armed one goes on."""
    with armed_flight(guard, library, tmp_path) as (fc, client):
        armed = client.ok("save")["data"]
        client.set("pilot.outputs.force", 1.0)
        guard.wait_last({**COMMAND, "number": 1.0})
        client.ok("restore", data=armed)
        guard.wait_last(COMMAND)
        client.set("pilot.outputs.armed", False)
        guard.wait_last(SAFE)
        client.ok("restore", data=armed)
        arms_anew(guard, client)
        _, out, _ = fc.stop()
    assert out.count(REQUIRED) == 1


def test_kill_in_the_middle_of_a_write(guard: Guard) -> None:
    """Half of a command is none: what was commanded before lasts until the time-out, and nothing else comes out."""
    program = [sys.executable, str(Path(__file__).with_name("guarding.py")), str(guard.slot), str(guard.log)]
    assert subprocess.run(program, timeout=PATIENCE_S, check=False).returncode == -signal.SIGKILL
    guard.wait_last(SAFE)
    guard.stays_safe()
    assert {write.values["number"] for write in guard.writes()} == {SAFE["number"], COMMAND["number"]}
    assert not guard.told("refused")
    slot = Slot(guard.slot)  # the next flight program does not stumble over it
    slot.write(command(3.0))
    guard.wait_last({"number": 3.0, "flag": 0.0})
    slot.close()


FUTURE_S = 3600
GOOD = command(-77.0)
#: What a flight program that has gone mad writes into the slot, and what the guard says of it.
NONSENSE: dict[str, tuple[Callable[[Slot], None], str]] = {
    "a flipped bit": (lambda s: s.write(GOOD[:40] + bytes([GOOD[40] ^ 1]) + GOOD[41:]), "checksum mismatch"),
    "nothing": (lambda s: s.write(b""), "truncated"),
    "cut short": (lambda s: s.write(GOOD[:-1]), "truncated"),
    "an impossible size": (lambda s: s.write(GOOD, size=2**64 - 1), "truncated"),
    "a size beyond the slot": (lambda s: s.write(GOOD, size=len(s.memory)), "truncated"),
    "a command from the future": (
        lambda s: s.write(GOOD, begun_ns=time.monotonic_ns() + FUTURE_S * 10**9), "its time is in the future"
    ),
    "all bits": (lambda s: s.write(b"\xff" * len(GOOD)), "it does not begin as a message of this kind"),
}  # fmt: skip


@pytest.mark.parametrize("what", NONSENSE)
def test_nonsense_is_refused(guard: Guard, what: str) -> None:
    """It is no sign of life either: the actuators become safe, however often it comes."""
    nonsense, reason = NONSENSE[what]
    slot = Slot(guard.slot)

    def arm() -> bool:
        slot.write(command(COMMAND["number"]))
        return guard.last() == COMMAND

    def repeat() -> bool:
        nonsense(slot)
        return guard.last() == SAFE

    wait_for(arm)
    wait_for(repeat)
    guard.wait_line(f"refused a command: {reason}")
    assert {write.values["number"] for write in guard.writes()} == {SAFE["number"], COMMAND["number"]}
    wait_for(arm)
    slot.close()


def test_an_old_command_is_no_command(guard: Guard) -> None:
    """One that was written longer ago than the time-out: the guard was late, or the writer."""
    slot = Slot(guard.slot)
    slot.write(command(COMMAND["number"]), begun_ns=time.monotonic_ns() - int((TIMEOUT_S + 1) * 1e9))
    guard.wait_line("silent")
    slot.close()
    assert all(write.values == SAFE for write in guard.writes())


def test_a_flood_and_a_trampled_head(guard: Guard) -> None:
    """A sequence that runs away, and lies where the guard wrote: it reads no more than it has."""
    slot = Slot(guard.slot)
    slot.memory[:88] = b"\xff" * 88
    for _ in range(20000):
        slot.write(GOOD, size=2**63)
    guard.wait_line("refused a command: truncated")
    assert len(guard.told("refused")) < 100 and guard.last() == SAFE
    slot.close()


@pytest.fixture
def patient(build_guarded: BuildGuarded) -> Path:
    """Its actuators keep a command for longer than a test takes: nothing but the end of the guard changes them."""
    return build_guarded("TIMEOUT_NS=60000000000u")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGABRT, signal.SIGTERM])
def test_kill(patient: Path, tmp_path: Path, number: signal.Signals) -> None:
    """A command ends with its program, however that ends and however long its machine lets a command last."""
    with guarding(patient, tmp_path) as guard, armed_flight(guard, patient, tmp_path) as (fc, _):
        fc.process.send_signal(number)
        guard.wait_last(SAFE)
        guard.stays_safe()
        guard.wait_line("disarmed, at tick")
        guard.wait_line(f"process {fc.process.pid} has left the slot")
        with armed_flight(guard, patient, tmp_path, "again"):
            pass


def test_the_guard_ends_with_safe_values(patient: Path, tmp_path: Path) -> None:
    with guarding(patient, tmp_path) as guard, armed_flight(guard, patient, tmp_path) as (fc, _):
        assert guard.end() == 0
        assert guard.last() == SAFE and [w.values for w in guard.writes()][-2] == COMMAND
        assert fc.process.poll() is None
    assert guard.lines[-1] == "fcsl-guard: the actuators have their safe values\n"
    counts = re.search(
        r"(\d+) periods, \d+ missed; (\d+) commands, 0 refused, \d+ silences; 0 writes missed", guard.lines[-2]
    )
    assert counts and int(counts[1]) >= int(counts[2]) > 0
    assert not guard.slot.exists()


@pytest.mark.parametrize(
    "name", ["SIGINT", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGXCPU", "SIGPWR", "SIGRTMAX"]
)
def test_every_signal_that_ends_the_guard_leaves_safe_values(patient: Path, tmp_path: Path, name: str) -> None:
    with guarding(patient, tmp_path) as guard:
        slot = Slot(guard.slot)
        slot.write(command(COMMAND["number"]))
        guard.wait_last(COMMAND)
        assert guard.end(signal.Signals[name]) == 0
        assert guard.last() == SAFE
        slot.close()


def test_no_terminal_stops_the_guard(guard: Guard) -> None:
    status = Path(f"/proc/{guard.process.pid}/status").read_text()
    ignored = int(re.search(r"SigIgn:\s*(\w+)", status)[1], 16)  # type: ignore[index]
    assert all(ignored >> (number - 1) & 1 for number in (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))


def test_a_killed_guard_leaves_the_last_command(patient: Path, tmp_path: Path) -> None:
    """The limit of it, stated in docs/hardware/arming.md: only the device or a hardware watchdog can do something then. A guard that
    starts again writes safe values first, and the flight program must be started again, too."""
    with guarding(patient, tmp_path) as guard, armed_flight(guard, patient, tmp_path) as (fc, _):
        guard.end(signal.SIGKILL)
        assert guard.last() == COMMAND
        with guarding(patient, tmp_path) as second:
            assert second.slot == guard.slot
            second.stays_safe()
        code, out, err = fc.stop()
        assert code == 0 and "fcsl-guard has ended" in err and "fcsl-fc: guard: ended before the run did\n" in out


def test_a_stopped_guard_knows_how_old_its_command_is(guard: Guard) -> None:
    slot = Slot(guard.slot)

    def arm() -> bool:
        slot.write(command(COMMAND["number"]))
        return guard.last() == COMMAND

    wait_for(arm)
    guard.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, guard.process.pid, os.WSTOPPED | os.WNOWAIT)
    slot.write(command(-77.0))
    time.sleep(2 * TIMEOUT_S)  # it is what the guard has to notice
    guard.process.send_signal(signal.SIGCONT)
    guard.wait_last(SAFE)
    guard.wait_line("periods missed so far")
    assert -77.0 not in {write.values["number"] for write in guard.writes()}
    slot.close()


def test_the_page_names_tests_that_there_are() -> None:
    page = (ROOT / "docs/hardware/arming.md").read_text()
    named = set(re.findall(r"`(test_\w+)`", page))
    files = [Path(__file__).with_name(f"test_guard{name}.py") for name in ("", "_assignment", "_board")]
    assert len(named) > 10 and named <= {
        n for file in files for n in re.findall(r"^def (test_\w+)", file.read_text(), re.M)
    }


def test_the_summary_tells_of_the_guard(guard: Guard, library: Path, tmp_path: Path) -> None:
    for options, state in ((("--guard", guard.slot), "there"), ((), "none")):
        with flying("--ticks", "1", "--summary", tmp_path / "end", *options, library=str(library)) as fc:
            assert fc.wait()[0] == 0
        assert json.loads((tmp_path / "end").read_text())["guard"] == state


def test_a_guard_that_does_not_answer(library: Path, tmp_path: Path) -> None:
    """Its queue is full, so nobody can even connect to it."""
    path = tmp_path / "slot"
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)) for _ in range(2)]
        sockets[0].bind(str(path))
        sockets[0].listen(0)
        sockets[1].connect(str(path))
        with flying("--guard", path, library=str(library)) as fc:
            code, _, err = fc.wait()
    assert code == 1 and f"cannot connect to socket '{path}'" in err


def test_a_guard_needs_real_time(library: Path, tmp_path: Path) -> None:
    with flying("--guard", tmp_path / "slot", "--rate", "max", library=str(library)) as fc:
        code, _, err = fc.wait()
    assert code == 2 and "--guard with --rate max" in err


def test_without_a_guard_nothing_starts(library: Path, tmp_path: Path) -> None:
    with flying("--guard", tmp_path / "slot", library=str(library)) as fc:
        assert fc.wait()[::2] == (1, f"fcsl-fc: nobody listens on socket '{tmp_path / 'slot'}'\n")


def test_a_guard_of_other_sources_is_refused(guard: Guard, build_guarded: BuildGuarded) -> None:
    other = build_guarded('HASH="' + "6" * 64 + '"')
    with flying("--guard", guard.slot, library=str(other)) as fc:
        code, _, err = fc.wait()
    assert code == 1 and "a machine of other sources (555555555555, here 666666666666)" in err
