# SPDX-License-Identifier: Apache-2.0
"""fcsl var against the flight program: what it prints, its exit statuses, its completion, its curves."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pty
import select
import shutil
import signal
import socket
import struct
import subprocess
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import cast

import pytest
from kill_points import CannotTrace, calls_until_killed
from native import Fc, flying

from fcsl_compiler.cli.complete import SHELLS, candidates, words_of
from simclient.screen import Screen
from simclient.vars.arguments import make_parser
from simclient.vars.cli import main
from simclient.vars.client import VarClient
from simclient.vars.find import Server, find_server, named_address, running_servers
from simclient.vars.subscription import Sample, Subscription
from simclient.vars.terminal_plot import Canvas, draw_panel
from simclient.vars.value_text import read_value
from simclient.vars.watch import _Table, _until
from simclient.vars.wire import VarError
from simclient.verbs import COMMANDS

Tell = Callable[..., str]


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Fc]:
    """The fixture machine, paused at tick 0, serving `fc` in tmp_path."""
    with flying("--socket", tmp_path / "fc", "--paused") as fc:
        fc.client(tmp_path / "fc").close()
        yield fc


@pytest.fixture
def tell(flight: Fc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Tell:
    """Runs fcsl var; returns its output and, when it fails, what it says, behind the status."""
    monkeypatch.setenv("FCSL_SOCKET", str(tmp_path / "fc"))

    def run(*arguments: str | Path) -> str:
        status = main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return out if status == 0 and not err else f"{status}: {out}{err}"

    return run


def test_values(tell: Tell) -> None:
    assert tell("get", "machine.tick", "sensors.outputs.gyro").splitlines() == [
        "machine.tick          0",
        "sensors.outputs.gyro  [0.0, 0.0, 0.0] rad/s",
    ]
    said = tell("set", "sensors.outputs.gyro=[1, 2.5, 1e-300]", "sensors.outputs.armed=true")
    assert said.removeprefix("0: ").startswith("tick 0  IDLE") and "paused" in said
    assert json.loads(tell("get", "sensors.outputs.gyro", "--json")) == {"sensors.outputs.gyro": [1.0, 2.5, 1e-300]}
    said = tell("set", "pilot.inputs.gyro=[1, 2, 3]")
    assert said.splitlines()[-1] == "fcsl var: note: pilot.inputs.gyro will be overwritten by sensors.outputs.gyro"
    assert tell("get", "pilot.inputs.gyro") == "pilot.inputs.gyro  [1.0, 2.0, 3.0] rad/s\n"
    assert tell("set", "sensors.outputs.gyro[0]=nan", "--allow-non-finite")
    assert json.loads(tell("get", "sensors.outputs.gyro[0]", "--json")) == {"sensors.outputs.gyro[0]": "nan"}
    assert tell("eval", "sensors.outputs.gyro[1] * 2") == "5.0\n" and tell("eval", "1 < 2", "--json") == "true\n"
    assert tell("tick", "50000").startswith("tick 50000  ") and tell("state").startswith("tick 50000  ")
    below = tell("get", "sensors.outputs").splitlines()
    assert [line.split()[0] for line in below] == [
        path for path in tell("list", "sensors.outputs.").split() if "." in path and path.startswith("sensors")
    ]
    assert json.loads(tell("--json", "list", "machine."))[0]["path"] == "machine.tick"
    assert tell("--socket", "/nonexistent", "state").startswith("2: ")
    assert "unit      rad/s" in tell("describe", "sensors.outputs.gyro") and "tick_hz" in tell("describe")
    stats = json.loads(tell("stats", "--json"))
    assert stats["ticks"] == 50000 and "tick_time_ns.p50" in tell("stats") and "buckets" not in tell("stats")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.5", 1.5),
        ("18446744073709551615", 2**64 - 1),
        ("true", True),
        ("False", False),
        ("-inf", -math.inf),
        ("-Infinity", -math.inf),
        ("RUN", "RUN"),
        ('"nan"', "nan"),
        ("two words", "two words"),
        ("[1, 2.5, -inf]", [1, 2.5, -math.inf]),
        ("[[inf,-1],[True,false]]", [[math.inf, -1], [True, False]]),
        ('[RUN, "two words", tr_GO]', ["RUN", "two words", "tr_GO"]),
        ("[1, 2", "[1, 2"),
        ("[1 2]", "[1 2]"),
        ('{"a": [1]}', {"a": [1]}),
    ],
)
def test_values_as_they_are_written_in_a_shell(text: str, value: object) -> None:
    assert read_value(text) == value and type(read_value(text)) is type(value)


def test_a_list_with_nan(tell: Tell) -> None:
    assert tell("set", "sensors.outputs.gyro=[1, nan, inf]", "--allow-non-finite")
    assert "[1.0, nan, inf]" in tell("get", "sensors.outputs.gyro")
    assert "say --allow-non-finite if" in tell("set", "sensors.outputs.gyro=[1, nan, inf]")


def test_a_token_that_is_not_named_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with flying("--socket", "tcp:127.0.0.1:0", "--token", tmp_path / "token", "--paused") as fc:
        assert fc.process.stdout is not None
        address = next(line.split()[-1] for line in fc.process.stdout if "commands on" in line)
        assert main(["--socket", address, "state"]) == 2 and "name its file, --token FILE" in capsys.readouterr().err
        assert main(["--socket", address, "--token", str(tmp_path / "token"), "state"]) == 0


def test_a_path_and_a_value_may_be_two_words(tell: Tell) -> None:
    assert tell("set", "sensors.outputs.gyro[1]", "2.5").startswith("tick ")
    assert tell("eval", "sensors.outputs.gyro[1]") == "2.5\n"


def test_state_and_checkpoints(tell: Tell, tmp_path: Path) -> None:
    tell("set", "sensors.outputs.gyro[0]=1.5")
    assert "tick 0, " in tell("save", tmp_path / "kept")
    tell("tick", "7")
    tell("set", "sensors.outputs.gyro[0]=9")
    assert tell("restore", tmp_path / "kept").startswith("tick 0  ")
    assert tell("eval", "sensors.outputs.gyro[0]") == "1.5\n"
    whole = (tmp_path / "kept").read_bytes()
    for content in (b"{}", whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1])):
        (tmp_path / "kept").write_bytes(content)
        assert tell("restore", tmp_path / "kept").startswith("1: fcsl var: ") and tell("state").startswith("tick 0  ")
    assert "cannot be read" in tell("restore", tmp_path / "absent")
    other = whole[:56] + b"0" * 64 + whole[120:-4]
    (tmp_path / "kept").write_bytes(other + struct.pack("<I", zlib.crc32(other)))
    assert "other sources" in tell("restore", tmp_path / "kept")
    assert tell("restore", "--ignore-source-hash", tmp_path / "kept").startswith("tick 0  ")
    assert "--checkpoints" in tell("save", "kept", "--remote") and "--checkpoints" in tell(
        "restore", "kept", "--remote"
    )
    states = json.loads(tell("describe", "--json"))["states"]
    assert states[1] in tell("set-state", states[1])
    assert "paused" not in tell("resume") and "paused" in tell("pause")


def test_a_checkpoint_is_written_as_every_other(tell: Tell, tmp_path: Path) -> None:
    """docs/guide/recording.md, "The file": what a kill leaves is the old file or the new one, and <path>.tmp at most."""
    kept = tmp_path / "kept"
    kept.mkdir()
    assert tell("save", kept / "file").startswith("tick 0, ")
    new, left = (kept / "file").read_bytes(), set()
    try:
        calls = calls_until_killed(1 << 60, lambda: main(["save", str(kept / "file")]))
    except CannotTrace:
        pytest.skip("this system does not let a process trace its child")
    (kept / "file").write_bytes(b"old")
    for call in range(1, calls, 3):  # most of them are Python's own
        calls_until_killed(call, lambda: main(["save", str(kept / "file")]))
        left.add((kept / "file").read_bytes())
        assert {path.name for path in kept.iterdir()} <= {"file", "file.tmp"}
    assert left == {b"old", new}
    said = tell("save", tmp_path / "absent" / "file")
    assert said.startswith("1: fcsl var: ") and "No such file" in said and str(tmp_path / "absent" / "file") in said


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["get", "sensors.outputs.giro"], 1, "no field 'sensors.outputs.giro'; did you mean `sensors.outputs.gyro`?"),
        (["set", "sensors.outputs.giro=1"], 1, "did you mean `sensors.outputs.gyro`?"),
        (["set", "sensors.outputs.armed=7"], 1, "bool"),
        (["set", "machine.tick=7"], 1, "cannot be set"),
        (["set", "sensors.outputs.armed"], 1, "PATH=VALUE"),
        (["set", "sensors.outputs.gyro[0]=nan"], 1, "say --allow-non-finite if"),
        (["set", "sensors.outputs.armed", "true", "sensors.outputs.count"], 1, "PATH=VALUE"),
        (["set", "sensors.outputs.armed=true", "false"], 1, "PATH=VALUE"),
        (["set-state", "IDEL"], 1, "did you mean `IDLE`?"),
        (["list", "nothing"], 1, "no path begins"),
        (["watch", "nothing"], 1, "no field 'nothing'"),
        (["plot", "machine.state", "--ticks", "5"], 1, "'IDLE' is not a number"),
        (["plot", "machine.tick"], 1, "--ticks"),
        (["state", "--socket", "/nonexistent"], 2, "/nonexistent: No such file"),
    ],
)
def test_what_is_refused(tell: Tell, arguments: list[str], status: int, said: str) -> None:
    told = tell(*arguments)
    assert told.startswith(f"{status}: fcsl var: ") and said in told and len(told.splitlines()) == 1


def test_wrong_usage() -> None:
    for arguments in (
        ["nonsense"],
        [],
        ["tick", "0"],
        ["tick", "-1"],
        ["watch", "x", "--every", "0"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 2


def test_the_only_machine_is_found(flight: Fc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mine = Server(str(tmp_path / "fc"), "fcsl-fc", flight.process.pid)
    assert mine in running_servers()
    with flying("--socket=other", "--paused") as other:
        other.client(tmp_path / "other").close()
        assert {mine, Server(str(tmp_path / "other"), "fcsl-fc", other.process.pid)} <= set(running_servers())
    assert str(tmp_path / "other") not in {server.address for server in running_servers()}
    a, b = Server("/a", "fcsl-fc", 7), Server("/b", "fcsl-sim", 8)
    monkeypatch.setattr("simclient.vars.find.running_servers", lambda: [a])
    assert find_server() == a
    for found, message in (
        ([], "none of your fcsl-fc"),
        ([a, b], r"several run: fcsl-fc \(process 7\) on /a, fcsl-sim \(process 8\) on /b"),
    ):
        monkeypatch.setattr("simclient.vars.find.running_servers", lambda found=found: found)
        with pytest.raises(VarError, match=message):
            find_server()
    monkeypatch.delenv("FCSL_SOCKET", raising=False)
    assert named_address("given") == "given" and named_address(None) is None
    monkeypatch.setenv("FCSL_SOCKET", "/c")
    assert named_address(None) == "/c"


def test_a_machine_that_was_not_named_is_read_and_not_changed(
    flight: Fc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It may be somebody else's experiment: what is read says whose it is, and nothing is written."""
    server = Server(str(tmp_path / "fc"), "fcsl-fc", flight.process.pid)
    monkeypatch.delenv("FCSL_SOCKET", raising=False)
    monkeypatch.setattr("simclient.vars.find.running_servers", lambda: [server])
    assert main(["get", "machine.tick"]) == 0
    assert capsys.readouterr().err == f"fcsl var: {server}\n"
    changing = ("set machine.tick=1", "set-state X", "tick", "pause", "resume", f"restore {tmp_path / 'none'} --remote")
    for command in changing:
        assert main(command.split()) == 2
        assert f"which machine? {server} runs; name it with --socket" in capsys.readouterr().err


def test_what_runs_is_found_by_its_command_line(tmp_path: Path) -> None:
    lines = {
        "1": "/opt/bin/fcsl-fc libx.so --socket a.sock --paused",
        "2": "python3 /opt/bin/fcsl-sim run x.sim.json --socket=b.sock",
        "8": "python3 /opt/bin/fcsl sim x.sim.json --socket c.sock",
        "9": "python3 /opt/bin/fcsl plot x.sim.json --socket c.sock",
        "3": "fcsl-fc libx.so --socket tcp:127.0.0.1:7500 --token t",
        "4": "fcsl-fc libx.so --socket gone.sock",
        "5": "fcsl-fc libx.so",
        "6": "socat - UNIX:fcsl-fc --socket a.sock",
        "self": "fcsl-fc libx.so --socket a.sock",
    }
    for number, line in lines.items():
        (tmp_path / number).mkdir()
        (tmp_path / number / "cmdline").write_text(line.replace(" ", "\0") + "\0")
        (tmp_path / number / "cwd").symlink_to(tmp_path)
    (tmp_path / "7").mkdir()
    with ExitStack() as opened:
        for name in "abc":
            opened.enter_context(socket.socket(socket.AF_UNIX)).bind(str(tmp_path / f"{name}.sock"))
        assert running_servers(tmp_path) == [
            Server(str(tmp_path / "a.sock"), "fcsl-fc", 1),
            Server(str(tmp_path / "b.sock"), "fcsl-sim", 2),
            Server(str(tmp_path / "c.sock"), "fcsl-sim", 8),
            Server("tcp:127.0.0.1:7500", "fcsl-fc", 3),
        ]


def test_watch_is_a_line_for_each_sample(tell: Tell, tmp_path: Path) -> None:
    tell("resume")
    said = tell("watch", "machine.tick", "sensors.outputs.gyro[0]", "--every", "5", "--ticks", "20")
    lines = said.splitlines()
    assert len(lines) == 4
    for line in lines:
        tick = int(line.split()[0])
        assert tick % 5 == 0 and line == f"{tick}  machine.tick = {tick}  sensors.outputs.gyro[0] = 0.0 rad/s"
    samples = [json.loads(line) for line in tell("watch", "machine", "--ticks", "3", "--json").splitlines()]
    assert len(samples) == 3 and all(s["values"]["machine.tick"] == s["tick"] for s in samples)


@pytest.mark.parametrize(("every", "ticks", "last"), [(1, 3, 3), (5, 20, 20), (5, 24, 20), (5, 26, 25), (10, 5, 10)])
def test_watch_ends_with_the_last_sample_due(every: int, ticks: int, last: int) -> None:
    """Lost samples are ticks that went by, too; where none is due in so many ticks, the first one is waited for."""
    for lost in (0, 2):
        samples = [Sample(at, 0, lost, {}) for at in range((1 + lost) * every, 100, every)]
        seen = [sample.tick for sample in _until(cast("Subscription", iter(samples)), every, ticks)]
        assert seen == [sample.tick for sample in samples if sample.tick <= last] or seen == [samples[0].tick]


def test_what_a_terminal_has_no_room_for_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """24 columns and 5 lines, of which the last is the shell's."""
    monkeypatch.setattr(shutil, "get_terminal_size", lambda *_: os.terminal_size((24, 5)))
    for fields, shown in ((3, ["tick 7", "f0  0 m", "f1  0 m", "f2  0 m"]), (4, ["tick 7", "f0  0 m", "f1  0 m"])):
        values = {f"f{i}": 0 for i in range(fields)}
        table = _Table(dict.fromkeys(values, "m"))
        table.take(Sample(7, 0, 0, values))
        Screen().draw(table.lines(*Screen.size()))
        lines = [line.removesuffix("\x1b[K") for line in capsys.readouterr().out.removesuffix("\x1b[J").splitlines()]
        assert lines == shown + ["… 2 lines more: no room"] * (fields - 3)
    table = _Table({"p": ""})
    table.take(Sample(7, 0, 0, {"p": [1.0] * 9}))
    Screen().draw(table.lines(*Screen.size()))
    assert capsys.readouterr().out.splitlines()[1] == "p  [1.0, 1.0, 1.0, 1.0,…\x1b[K"


def test_plot_of_a_ramp(tell: Tell) -> None:
    tell("resume")
    lines = tell("plot", "machine.tick", "sensors.outputs.gyro", "--ticks", "50").splitlines()
    assert lines[0].startswith("machine.tick = ") and any(line.startswith("sensors.outputs.gyro = [") for line in lines)
    rows = [
        line.split("┤")[-1].split("│")[-1] for line in lines[1 : next(i for i, line in enumerate(lines) if "└" in line)]
    ]
    inked = [[x for x, c in enumerate(row) if c != "⠀"] for row in rows]
    assert (
        all(inked) and inked[0][-1] == len(rows[0]) - 1 and inked[-1][0] == 0
    )  # from the lower left to the upper right
    assert all(above[0] >= below[0] for above, below in zip(inked, inked[1:], strict=False))


def test_completion_knows_every_command_and_option() -> None:
    (commands,) = [a.choices for a in make_parser()._actions if isinstance(a.choices, dict)]
    assert sorted(candidates(COMMANDS.verbs, ["var", ""])) == sorted(commands)
    for name, parser in commands.items():
        options = [
            option for action in parser.filled()._actions for option in action.option_strings if option[:2] == "--"
        ]
        assert set(options) <= set(candidates(COMMANDS.verbs, ["var", name, "--"])), name


def test_completion(tell: Tell, tmp_path: Path) -> None:
    def completed(*words: str | Path) -> list[str]:
        return candidates(COMMANDS.verbs, ["var", *map(str, words)])

    assert set(completed("s")) == {"set", "state", "set-state", "save", "save-parameters", "stats"}
    assert completed("get", "sensors.o") == ["sensors.outputs."]
    assert "sensors.outputs.gyro=" in completed("set", "sensors.outputs.")
    assert "IDLE" in completed("set-state", "")
    assert completed("watch", "--e") == ["--every"] and completed("--t") == ["--token"] and not completed("--v")
    assert completed("--socket", tmp_path / "fc", "--json", "descr") == ["describe"]
    assert completed("--socket", tmp_path / "fc", "get", "mach") == ["machine."]
    assert not completed("get", "--socket", tmp_path / "no", "mach") and not completed("nonsense", "x")
    for line in ("get mach", 'get "mach', "get 'mach", "--socket='{}' get mach"):
        assert completed(*words_of(f"var {line}".format(tmp_path / "fc"))[1:]) == ["machine."]


_RC = {
    "zsh": (
        ".zshrc",
        "autoload -U compinit; compinit -u -D",
        'print -r -- "$BUFFER:"',
        "zle -N show; bindkey '^X' show; bindkey '^I' complete-word",
    ),
    "bash": (
        ".bashrc",
        "bind 'set bell-style none'",
        "printf '%s:\\n' \"$READLINE_LINE\"",
        "bind -x '\"\\C-x\": show'",
    ),
}


@pytest.mark.parametrize(
    "shell", [pytest.param(s, marks=pytest.mark.skipif(shutil.which(s) is None, reason=f"no {s} here")) for s in _RC]
)
@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("get sensors.outputs.gy", "get sensors.outputs.gyro "),
        ("get mach", "get machine."),
        ("set sensors.outputs.gy", "set sensors.outputs.gyro="),
        ("set-state ID", "set-state IDLE "),
        ("unsub", "unsub"),
        ("--socket=./a:b get mach", "--socket=./a:b get machine."),
        (r"--socket a\ c get mach", r"--socket a\ c get machine."),
    ],
)
def test_completion_on_a_terminal(tell: Tell, tmp_path: Path, shell: str, typed: str, line: str) -> None:
    """The shell's own line editor: the Tab key, and what stands in the line then."""
    for name in ("a:b", "a c"):
        (tmp_path / name).symlink_to("fc")
    file, begin, show, bind = _RC[shell]
    (tmp_path / file).write_text(
        f"PS1=READY; {begin}; {SHELLS[shell]}\nshow() {{ {show} > $ZDOTDIR/line; exit; }}\n{bind}\n"
    )
    environment = {**os.environ, "ZDOTDIR": str(tmp_path), "TERM": "xterm"}
    command = ["zsh", "-i"] if shell == "zsh" else ["bash", "--noprofile", "--rcfile", str(tmp_path / file), "-i"]
    main_end, terminal = pty.openpty()
    running = subprocess.Popen(
        command, stdin=terminal, stdout=terminal, stderr=terminal, env=environment, cwd=tmp_path, start_new_session=True
    )
    os.close(terminal)
    deadline, said = time.monotonic() + 20, b""
    while not (tmp_path / "line").exists() or not (tmp_path / "line").read_text():
        assert time.monotonic() < deadline, said
        if select.select([main_end], [], [], 0.05)[0]:
            with contextlib.suppress(OSError):  # the end of the terminal
                said += os.read(main_end, 4096)
        if b"READY" in said and typed:
            os.write(main_end, f"fcsl var {typed}\t\x18".encode())
            typed = ""
    running.kill()
    running.wait()
    os.close(main_end)
    assert (tmp_path / "line").read_text() == f"fcsl var {line}:\n"


def test_a_terminal_is_drawn_over_and_ctrl_c_is_the_end(tell: Tell, tmp_path: Path) -> None:
    tell("resume")
    main_end, terminal = pty.openpty()
    for command in ("watch", "plot"):
        watching = subprocess.Popen(["fcsl", "var", command, "machine.tick"], stdout=terminal, stderr=subprocess.PIPE)
        seen = b""
        while seen.count(b"\x1b[J") < 3:
            seen += os.read(main_end, 1 << 16)
        watching.send_signal(signal.SIGINT)
        _, said = watching.communicate(timeout=10)
        while not seen.endswith(b"\x1b[?25h"):
            seen += os.read(main_end, 1 << 16)
        assert watching.returncode == 0 and said == b"" and seen.startswith(b"\x1b[?25l") and b"A\r" in seen
    os.close(terminal)
    os.close(main_end)


def test_dots_are_where_the_values_are() -> None:
    """Against the bits of the braille block as Unicode numbers them."""
    for x in range(8):
        for y in range(12):
            canvas = Canvas(4, 3)
            canvas.dot(x, y)
            rows = canvas.rows()
            bit = {(0, 3): 0, (0, 2): 1, (0, 1): 2, (1, 3): 3, (1, 2): 4, (1, 1): 5, (0, 0): 6, (1, 0): 7}[x % 2, y % 4]
            assert ord(rows[2 - y // 4][x // 2]) == 0x2800 + (1 << bit)
            assert sum(c != "⠀" for row in rows for c in row) == 1
    canvas = Canvas(2, 1)
    canvas.dot(-1, 0), canvas.dot(4, 0), canvas.dot(0, 4)
    assert canvas.rows() == ["⠀⠀"]


def test_curves_with_gaps_and_extremes() -> None:
    lines = draw_panel("t", [0, 1, 2, 3], [[1.0, math.nan, 1.0, math.inf]], 40, 4)
    assert lines[0] == "t" and sum(c not in "⠀ │┤" for c in lines[3].split("┤")[-1]) == 2  # two dots and no line
    for values in ([1e308, -1e308], [math.nan, math.nan], [5.0, 5.0], [0.0, 5e-324], [1.79e308, 1.79e308]):
        assert all(len(line) <= 60 for line in draw_panel("t", [7, 8], [values], 60, 5))


@pytest.mark.parametrize(("width", "drawn"), [(60, 60), (30, 30), (20, 23), (3, 23)])
def test_a_panel_is_as_wide_as_its_terminal(width: int, drawn: int) -> None:
    """In one of fewer than 23 columns, 10 are left to the curve."""
    title, *lines = draw_panel("a long title " * 9, [5, 7], [[1.0, -1.0]], width, 4)
    assert len(title) == width and {len(line) for line in lines[:-1]} == {drawn}
    assert len(lines[-1]) <= drawn and lines[-1].endswith("tick 7")


def test_the_client_is_let_go(tell: Tell, tmp_path: Path) -> None:
    for _ in range(100):
        tell("state")
    with VarClient(tmp_path / "fc") as client:
        assert client.stats()["clients_dropped"] == 0
