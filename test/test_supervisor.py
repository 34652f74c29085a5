# SPDX-License-Identifier: Apache-2.0
"""docs/guide/monitoring.md: its commands print the shown output; and a supervisor of simulations."""

import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fcsl_compiler.base.packages import package_prefix
from simclient import VarClient
from simclient.supervisor.limits import STALLED_S

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "fcsl_runtime/simclient/test"))
from supervising import Supervisor, end, is_gone, supervising, wait_until  # noqa: E402

DOC = ROOT / "docs/guide/monitoring.md"
_PATIENCE_S = 30.0


def blocks(kind: str) -> list[str]:
    section = DOC.read_text().partition("\n## Supervisor\n")[2].partition("\n## ")[0]
    return re.findall(rf"^```{kind}\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The port of the page's supervisor."""
    (start,) = blocks("sh start")
    *before, program = start.replace("install/minimal", package_prefix("minimal").as_posix()).splitlines()
    folder = tmp_path_factory.mktemp("supervisor")
    for command in before:
        subprocess.run(["bash", "-c", command], cwd=folder, check=True)
    given = [*shlex.split(program), "--listen", "tcp:127.0.0.1:0"]
    with subprocess.Popen(given, cwd=folder, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        yield said.partition("http://127.0.0.1:")[2].partition("/")[0]
        process.send_signal(signal.SIGTERM)
    assert process.returncode == 0


def pattern_of(shown: str) -> re.Pattern[str]:
    """`…` matches text that differs between runs."""
    return re.compile(".*?".join(re.escape(part) for part in shown.split("…")), re.DOTALL)


def test_what_is_left_out_is_all_that_may_differ() -> None:
    pattern = pattern_of('{"a":…,"b":1}\n')
    assert pattern.fullmatch('{"a":5,"b":1}\n') and not pattern.fullmatch('{"a":5,"b":2}\n')


@pytest.mark.skipif(shutil.which("curl") is None, reason="the page shows curl, which is not installed")
def test_the_page(port: str) -> None:
    (transcript,) = blocks("console")
    commands = transcript.removeprefix("$ ").split("\n$ ")
    assert len(commands) >= 11
    for text in commands:
        command, _, expected = text.replace("7700", port).partition("\n")
        pattern = pattern_of(expected.rstrip("\n") + "\n")
        # A GET may come before the last telemetry of the run before it.
        deadline = time.monotonic() + (0 if "-d " in command or "-X " in command else _PATIENCE_S)
        while not pattern.fullmatch(said := execute(command)):
            assert time.monotonic() < deadline, f"{command}\n{said}\nis not\n{expected}"
            time.sleep(0.05)
    (python,) = blocks("python")
    subprocess.run([sys.executable, "-c", python.replace("7700", port)], check=True)


def execute(command: str) -> str:
    return subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=_PATIENCE_S).stdout


# ---- simulations ------------------------------------------------------------------------------------------------------

LANDER = "sim/lander.sim.json"


@pytest.fixture
def supervisor() -> Iterator[Supervisor]:
    with supervising(ROOT / "examples/lander") as supervisor:
        yield supervisor


def ended(supervisor: Supervisor, run: str) -> Callable[[], bool]:
    return lambda: bool(supervisor.get(f"/runs/{run}").json["status"] == "ended")


def test_a_simulation(supervisor: Supervisor) -> None:
    options = {"seed": 3, "duration": 2.5, "set": {"altimeter.parameters.sigma": 0.25}, "telemetry_every": 2}
    run = supervisor.start(LANDER, "simulation", paused=True, **options)
    at = f"/runs/{run['id']}"
    assert run["status"] == "running"
    values = supervisor.get(f"{at}/values?path=altimeter.parameters.sigma&path=machine.tick").json["values"]
    assert values == {"altimeter.parameters.sigma": 0.25, "machine.tick": 0}
    assert supervisor.get(f"{at}/health").status == 200
    with VarClient(run["socket"]) as client:
        client.tick(10)
        window = f"{at}/windows?path=machine.state&ticks=1000"
        wait_until(lambda: supervisor.get(window).json["tick"] == [0, 2, 4, 6, 8])
        client.resume()
    wait_until(ended(supervisor, run["id"]))
    assert supervisor.get(at).json["exit"] == {"status": 1, "meaning": "the duration is over, and `until` never held"}
    assert all(tick % 2 == 0 for tick in supervisor.get(window).json["tick"])


def test_a_simulation_that_is_watched(supervisor: Supervisor) -> None:
    """At a millionth of real time its second tick is due in hours; meanwhile it is not reported as stuck."""
    run = supervisor.start(LANDER, "simulation", speed=1e-6)
    at = f"/runs/{run['id']}"
    wait_until(lambda: bool(supervisor.get(f"{at}/values?path=machine.tick").json["tick"] == 1))
    supervisor.get(f"{at}/health")
    time.sleep(STALLED_S + 0.1)
    health = supervisor.get(f"{at}/health").json
    assert (health["ok"], health["tick"], health["paused"]) == (True, 1, False)
    assert supervisor.ask("DELETE", at).json["exit"]["status"] == 143


def test_a_simulation_that_is_stopped(supervisor: Supervisor) -> None:
    run = supervisor.start(LANDER, "simulation", paused=True)
    answer = supervisor.ask("DELETE", f"/runs/{run['id']}").json
    assert answer["exit"] == {"status": 143, "meaning": "terminated on request"} and is_gone(run["pid"])


def test_a_simulation_that_cannot_begin(supervisor: Supervisor) -> None:
    for options, said in (({"set": {"altimeter.parameters.sigmaa": 1}}, "sigmaa"), ({"duration": 1e-9}, "ticks")):
        answer = supervisor.post({"kind": "simulation", "file": LANDER, "options": options})
        assert (answer.status, answer.code) == (422, "not_started") and said in answer.json["error"]["message"]
    for options in ({"speed": -1}, {"speed": 1e-300}, {"speed": "1"}, {"speed": True}, {"duration": 10**400}):
        answer = supervisor.post({"kind": "simulation", "file": LANDER, "options": options})
        assert (answer.status, answer.code) == (400, "bad_value")
    answer = supervisor.post({"kind": "simulation", "file": "fc/lander_control.json"})
    assert (answer.status, answer.code) == (400, "bad_value")


def test_a_killed_supervisor_leaves_no_simulation() -> None:
    supervisor = Supervisor(ROOT / "examples/lander")
    runs = [supervisor.start(LANDER, "simulation", paused=paused) for paused in (True, False)]
    supervisor.stop(signal.SIGKILL)
    supervisor.close()
    try:
        wait_until(lambda: all(is_gone(run["pid"]) for run in runs))
    finally:
        end([run["pid"] for run in runs])
