# SPDX-License-Identifier: Apache-2.0
"""Runs of a supervisor: started, watched, stopped, crashed, too many."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from native import FIXTURE
from supervising import ROOT, Answer, Supervisor, build_minimal, is_gone, supervising, wait_until

from simclient import VarClient
from simclient.supervisor import run_status
from simclient.supervisor.child import Child

LIBRARY = "libminimal.so"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    assert build_minimal(folder) == LIBRARY
    return folder


@pytest.fixture(scope="module")
def supervisor(root: Path) -> Iterator[Supervisor]:
    with supervising(
        root, patch="from simclient.supervisor import run_status; run_status.END_TIMEOUT_S = 60"
    ) as supervisor:
        yield supervisor


NAV = """class Nav:
    outputs = {"height": "f64 m"}
    def execute(self):
        self.height += 0.5
"""


def test_a_run_tells_its_views(supervisor: Supervisor, root: Path) -> None:
    """As an object; null where there are none, and where they cannot be drawn."""
    panel = {"title": "height", "angles": False, "estimate": ["nav.outputs.height"]}
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Nav": {"source": "nav.py"}},
        "instances": {"nav": {"algorithm": "Nav"}},
        "states": {"RUN": {"schedule": {"nav": 100}}},
        "views": {"panels": [panel]},
    }
    (root / "craft").mkdir()
    (root / "craft/nav.py").write_text(NAV)
    (root / "craft/craft.json").write_text(json.dumps(config))
    shutil.copy(FIXTURE, root / "libfixture.so")  # its text has no panel
    for file, views in (("craft/craft.json", {"panels": [panel]}), (LIBRARY, None), ("libfixture.so", None)):
        run = supervisor.start(file, paused=True)
        shown = supervisor.get(f"/runs/{run['id']}").json
        assert shown["channels"] and "views" in shown and shown["views"] == views
        supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_a_run_from_start_to_stop(supervisor: Supervisor, root: Path) -> None:
    run = supervisor.start(LIBRARY, summary="last.json", watchdog_ms=50)
    at = f"/runs/{run['id']}"
    assert run["status"] == "running" and run["file"] == LIBRARY and run["exit"] is None
    assert run["options"] == {"summary": "last.json", "watchdog_ms": 50}
    assert "pilot.outputs.force" in run["channels"] and run["log"][0].startswith("fcsl-fc: machine 'minimal', 1000 Hz")
    assert run["id"] in [one["id"] for one in supervisor.get("/runs").json["runs"]]
    health = supervisor.get(f"{at}/health")
    assert health.status == 200 and health.json["instances"] == {"sensors": "nominal", "pilot": "nominal"}
    with VarClient(run["socket"]) as client:
        client.set({"pilot.parameters.gain": 2.5})
    wait_until(lambda: supervisor.get(f"{at}/values?path=machine.tick").json["tick"] > 20)
    values = supervisor.get(f"{at}/values?path=pilot.parameters.gain&path=pilot.inputs&path=machine.state").json
    assert values["values"] == {
        "pilot.parameters.gain": 2.5,
        "pilot.inputs": {"theta": 0.0, "thetadot": 0.0},
        "machine.state": "RUN",
    }
    ended = supervisor.ask("DELETE", at)
    assert ended.status == 200 and ended.json["status"] == "ended" and ended.json["exit"]["status"] == 0
    assert is_gone(run["pid"]) and (root / "last.json").is_file()
    assert any(" ticks, " in line for line in ended.json["log"])
    assert supervisor.get(f"{at}/health").json == {"ok": False, "health": "ended"}
    assert supervisor.get(f"{at}/health").status == 503
    assert supervisor.ask("DELETE", at).json == ended.json  # and once more is the same
    last = supervisor.get(f"{at}/values?path=pilot.outputs.force").json  # what telemetry brought remains
    assert last["tick"] > 20 and last["values"] == {"pilot.outputs.force": 0.0}


def test_a_run_that_ends_by_itself(supervisor: Supervisor) -> None:
    run = supervisor.start(LIBRARY, ticks=5, rate="max")
    wait_until(lambda: supervisor.get(f"/runs/{run['id']}").json["status"] == "ended")
    ended = supervisor.get(f"/runs/{run['id']}").json
    assert ended["exit"] == {"status": 0, "meaning": "all ticks completed, or terminated on request"}
    refused = supervisor.get(f"/runs/{run['id']}/values?path=pilot.parameters.gain")
    assert (refused.status, refused.code) == (404, "unknown_path")  # parameters are not sent unless asked for
    assert "machine `minimal` sends no such field" in refused.json["error"]["message"]


def test_health_is_the_worst(supervisor: Supervisor) -> None:
    run = supervisor.start(LIBRARY, paused=True)
    at = f"/runs/{run['id']}/health"
    with VarClient(run["socket"]) as client:
        assert supervisor.get(at).json["health"] == "stale"  # nothing has run yet, which is no failure
        for what, status in (("degraded", 200), ("failed", 503), ("fault", 503)):
            client.inject("pilot", what)
            client.tick()
            answer = supervisor.get(at)
            assert (answer.status, answer.json["ok"]) == (status, status == 200)
            assert answer.json["health"] == ("failed" if what == "fault" else what)
            assert answer.json["instances"]["sensors"] == "nominal"
        client.tick()
        assert supervisor.get(at).json["health"] == "nominal" and supervisor.get(at).status == 200


def test_a_step_that_does_not_end_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """By ticks that stand still between looks; a paused one is not stuck, and neither is a slow one."""
    now = 100.0
    monkeypatch.setattr(run_status.time, "monotonic", lambda: now)
    run = SimpleNamespace(moved=(-1, 0.0))

    def stuck(tick: int, paused: bool = False, period_s: float = 1e-3) -> bool:
        return run_status._stalled(run, {"tick": tick, "paused": paused}, period_s)  # type: ignore[arg-type]

    assert not stuck(5)
    now += run_status.STALLED_S
    assert not stuck(5)
    now += 0.1
    assert stuck(5) and not stuck(5, paused=True) and not stuck(5) and not stuck(6)
    now += 2 * run_status.STALLED_S
    assert not stuck(6, period_s=run_status.STALLED_S + 0.1) and stuck(6) and not stuck(7)


def test_a_crashed_run(supervisor: Supervisor) -> None:
    run = supervisor.start(LIBRARY)
    os.kill(run["pid"], signal.SIGSEGV)
    words: list[str] = []
    wait_until(lambda: words.append(supervisor.get(f"/runs/{run['id']}/health").json["health"]) or words[-1] == "ended")
    assert set(words) <= {"nominal", "stale", "ended"}  # never one that means something else
    assert supervisor.get(f"/runs/{run['id']}").json["exit"] == {"status": -11, "meaning": "killed by SIGSEGV"}
    health = supervisor.get(f"/runs/{run['id']}/health")
    assert (health.status, health.json["health"]) == (503, "ended")


def test_a_run_that_cannot_begin(supervisor: Supervisor, root: Path) -> None:
    (root / "garbage.so").write_bytes(b"no library")
    refused = supervisor.post({"kind": "flight", "file": "garbage.so"})
    assert (refused.status, refused.code) == (422, "not_started") and "garbage.so" in refused.json["error"]["message"]
    name = refused.json["error"]["hint"].split()[1].removeprefix("/runs/")
    assert supervisor.get(f"/runs/{name}").json["exit"]["status"] == 1
    refused = supervisor.post({"kind": "flight", "file": LIBRARY, "options": {"machine": "nobody"}})
    assert (refused.status, refused.code) == (422, "not_started") and "nobody" in refused.json["error"]["message"]
    refused = supervisor.post({"kind": "flight", "file": LIBRARY, "options": {"record_fields": "*"}})
    assert (refused.status, refused.code) == (422, "not_started")
    name = refused.json["error"]["hint"].split()[1].removeprefix("/runs/")
    *_, reason, hint = supervisor.get(f"/runs/{name}").json["log"]
    assert refused.json["error"]["message"] == reason and "need --record" in reason and hint.startswith("Try `")


def test_a_machine_is_compiled_first(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples/minimal", tmp_path / "minimal", ignore=shutil.ignore_patterns("test"))
    with supervising(tmp_path) as supervisor:
        run = supervisor.start("minimal/minimal.json", ticks=3, rate="max")
        wait_until(lambda: supervisor.get(f"/runs/{run['id']}").json["status"] == "ended")
        ended = supervisor.get(f"/runs/{run['id']}").json
        assert ended["exit"]["status"] == 0 and ended["log"][0].startswith("fcsl-fc: machine 'minimal'")
        pilot = tmp_path / "minimal/algorithms/pilot.py"
        pilot.write_text(pilot.read_text() + "\nimport os\n")
        refused = supervisor.post({"kind": "flight", "file": "minimal/minimal.json"})
        assert (refused.status, refused.code) == (422, "not_started")
        assert "pilot.py" in refused.json["error"]["message"] and "error[" in refused.json["error"]["message"]
        assert supervisor.get("/runs/2").json["exit"]["status"] == 2


def test_one_that_does_not_answer_keeps_nobody_else_waiting(root: Path) -> None:
    patient = (
        "import simclient.supervisor.runs as r, simclient.supervisor.run_status as l; "
        "r.STOP_S = 600; l.STATUS_TIMEOUT_S = 0.5"
    )
    with supervising(root, patch=patient) as supervisor:
        run = supervisor.start(LIBRARY)
        at = f"/runs/{run['id']}"
        os.kill(run["pid"], signal.SIGSTOP)  # takes no SIGTERM, and answers nothing
        health = supervisor.get(f"{at}/health")
        assert (health.status, health.json["health"]) == (503, "unresponsive")
        assert b'fcsl_run_health{kind="flight",run="1"} 4.0\n' in supervisor.get("/metrics").body
        refused = supervisor.get(f"{at}/values?path=machine.tick")
        assert (refused.status, refused.code) == (504, "timeout")
        ended: list[Answer] = []
        stopping = threading.Thread(target=lambda: ended.append(supervisor.ask("DELETE", at)))
        stopping.start()
        wait_until(lambda: supervisor.get(at).json["status"] == "stopping")
        assert not ended and supervisor.get(f"{at}/health").json["health"] == "stopping"
        assert b'fcsl_run_health{kind="flight",run="1"} 4.0\n' in supervisor.get("/metrics").body
        os.kill(run["pid"], signal.SIGCONT)
        stopping.join()
        assert ended[0].json["exit"]["status"] == 0 and is_gone(run["pid"])
        assert b"fcsl_run_health{" not in supervisor.get("/metrics").body  # what has ended has none


def test_one_that_does_not_end_is_killed(root: Path) -> None:
    with supervising(root, patch="import simclient.supervisor.runs as r; r.STOP_S = 0.2") as supervisor:
        run = supervisor.start(LIBRARY)
        os.kill(run["pid"], signal.SIGSTOP)
        ended = supervisor.ask("DELETE", f"/runs/{run['id']}").json
        assert ended["exit"] == {"status": -9, "meaning": "killed by SIGKILL"} and is_gone(run["pid"])


def test_so_many_at_a_time_and_no_more(root: Path) -> None:
    with supervising(root, "--runs", "2") as supervisor:
        first, second = supervisor.start(LIBRARY), supervisor.start(LIBRARY)
        refused = supervisor.post({"kind": "flight", "file": LIBRARY})
        assert (refused.status, refused.code) == (409, "too_many_runs")
        supervisor.ask("DELETE", f"/runs/{first['id']}")
        assert supervisor.start(LIBRARY)["id"] != second["id"]
        assert supervisor.get("/health").json["runs"] == {"starting": 0, "running": 2, "stopping": 0, "ended": 1}


def test_what_cannot_be_started_leaves_nothing(root: Path) -> None:
    """Wherever the start runs out of descriptors."""
    with supervising(root, "--runs", "1") as supervisor:
        supervisor.start(LIBRARY, ticks=1, rate="max")
        pid, limits = supervisor.process.pid, resource.getrlimit(resource.RLIMIT_NOFILE)
        wait_until(lambda: supervisor.get("/health").json["runs"]["running"] == 0)
        free, answers = 1, []
        while not answers or answers[-1].status == 503:
            wait_until(lambda: not children(pid))
            resource.prlimit(pid, resource.RLIMIT_NOFILE, (descriptors(supervisor) + free, limits[1]))
            answers.append(supervisor.post({"kind": "flight", "file": LIBRARY, "options": {"paused": True}}))
            resource.prlimit(pid, resource.RLIMIT_NOFILE, limits)
            free += 1
        *refused, begun = answers
        assert len(refused) > 2 and {answer.code for answer in refused} == {"not_started"}
        folders = set(os.listdir(Path(begun.json["socket"]).parents[1]))
        assert begun.status == 201 and folders == {"1", begun.json["id"]}


def test_a_program_that_could_not_be_ended_is_not_left(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    def refuse(pid: int) -> int:
        begun.append(pid)
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(os, "pidfd_open", refuse)
    with pytest.raises(OSError, match="Too many open files"):
        Child(["/bin/sleep", "60"], signal.SIGKILL, b"", lambda: None)
    assert len(begun) == 1 and is_gone(begun[0])


def test_of_those_that_ended_the_last_are_kept(root: Path) -> None:
    few = "import simclient.supervisor.runs as runs; runs.ENDED_RUNS = 3"
    with supervising(root, "--runs", "1", patch=few) as supervisor:
        held = 0
        for number in range(1, 8):
            assert supervisor.start(LIBRARY, ticks=1, rate="max")["id"] == str(number)
            wait_until(lambda: supervisor.get("/health").json["runs"]["running"] == 0)
            held = held if number > 4 else descriptors(supervisor)
        wait_until(lambda: descriptors(supervisor) <= held)  # what was forgotten holds none
        assert [run["id"] for run in supervisor.get("/runs").json["runs"]] == ["5", "6", "7"]
        refused = supervisor.get("/runs/4")
        assert (refused.status, refused.code) == (404, "unknown_run")


def test_of_their_windows_the_oldest_go_first(root: Path) -> None:
    one_and_a_half = "import simclient.supervisor.runs as runs; runs.ENDED_WINDOW_BYTES = 10_000"
    with supervising(root, patch=one_and_a_half) as supervisor:
        for name in ("1", "2"):
            run = supervisor.start(LIBRARY, paused=True)
            with VarClient(run["socket"]) as client:
                client.tick(50)
            ended = supervisor.ask("DELETE", f"/runs/{name}")
            assert ended.json["status"] == "ended"
            # All that it sent is there as soon as it has ended: 50 rows of 128 bytes.
            assert supervisor.get(f"/runs/{name}/windows?path=machine.tick").json["tick"] == list(range(50))
        assert len(supervisor.get("/runs").json["runs"]) == 2
        refused = supervisor.get("/runs/1/windows?path=machine.tick")
        assert (refused.status, refused.code) == (409, "no_telemetry")
        assert supervisor.get("/runs/2/windows?path=machine.tick").json["tick"] == list(range(50))


def descriptors(supervisor: Supervisor) -> int:
    return len(list(Path(f"/proc/{supervisor.process.pid}/fd").iterdir()))


def children(pid: int) -> str:
    """Of any of its threads."""
    return "".join(task.read_text() for task in Path(f"/proc/{pid}/task").glob("*/children"))
