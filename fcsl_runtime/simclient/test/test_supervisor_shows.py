# SPDX-License-Identifier: Apache-2.0
"""What a supervisor shows: metrics that Prometheus can read, windows that are what telemetry brought."""

from __future__ import annotations

import io
import json
import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from native import flying
from prometheus_client.parser import text_string_to_metric_families
from supervising import Supervisor, supervising, wait_until
from test_events import config as reporting
from test_requirements import machine
from test_twin_lost_requests import BOTH, write
from vars_machine import build

from fcsl_compiler.driver.cache import build_machine
from simclient import VarClient
from simclient.supervisor import metrics
from simclient.supervisor.http_error import HttpError
from simclient.supervisor.windows import ARROW, cut
from simclient.telemetry.receiver import Telemetry

FIELDS = "hold.*,source.*,machine.*"
PATHS = ("hold.state.p", "hold.state.cube", "hold.state.line[3]", "hold.state.big", "hold.state.flag", "hold.state.count",
         "hold.outputs.health", "machine.state", "hold.inputs.free")  # fmt: skip


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    build(folder)
    return folder


@pytest.fixture(scope="module")
def library(root: Path) -> str:
    (library,) = root.glob("lib*.so")
    return library.name


@pytest.fixture(scope="module")
def supervisor(root: Path) -> Iterator[Supervisor]:
    with supervising(root) as supervisor:
        yield supervisor


def fly(client: VarClient, ticks: int) -> None:
    """Ticks that leave values of every kind, some of which JSON has no numbers for."""
    rng = np.random.default_rng(1)
    for tick in range(ticks):
        odd = [math.nan, math.inf, -math.inf, 0.1, -0.0, 5e-324][tick % 6]
        values: dict[str, Any] = {
            "hold.state.p": rng.normal(size=(4, 5)),
            "hold.state.cube": rng.integers(-(2**31), 2**31, (2, 3, 4)),
            "hold.state.line": rng.normal(size=7).astype(np.float32).astype(float),
            "hold.state.big": 2**64 - 1 - tick,
            "hold.state.flag": tick % 3 == 0,
            "hold.inputs.free": odd,
        }
        client.set(values, allow_non_finite=True)
        client.tick()
    client.set_state("WAIT")
    client.tick()


def same(left: Any, right: Any) -> bool:
    """Element by element; floats with all their bits, but for NaNs."""
    left, right = np.asarray(left), np.asarray(right)
    if left.dtype.kind != "f":
        return left.shape == right.shape and left.tolist() == right.tolist()
    signs = np.isnan(left) | (np.signbit(left) == np.signbit(right))
    return left.shape == right.shape and bool(np.array_equal(left, right, equal_nan=True) and signs.all())


def numbers(value: Any) -> Any:
    """JSON's words for numbers that it lacks."""
    if isinstance(value, list):
        return [numbers(item) for item in value]
    return float(value) if isinstance(value, str) and value in ("nan", "inf", "-inf") else value


def arrow(body: bytes) -> dict[str, Any]:
    with pa.ipc.open_stream(io.BytesIO(body)) as stream:
        table = stream.read_all()
    return {name: table.column(name).to_pylist() for name in table.column_names}


def test_windows_are_what_telemetry_brought(library: str, root: Path, tmp_path: Path) -> None:
    """JSON and Arrow against the receiver's own arrays, and those against the machine, tick for tick."""
    with Telemetry(0, window_ticks=100).start() as telemetry:
        address = f"udp:127.0.0.1:{telemetry.port}"
        given = ("--socket", tmp_path / "fc", "--paused", "--telemetry", address, "--telemetry-fields", FIELDS)
        with flying(*given, library=str(root / library)) as fc:
            fc.client(tmp_path / "fc").close()
            with VarClient(tmp_path / "fc") as client:
                fly(client, 20)
                telemetry.wait(ticks=21)
        found, expected = cut(telemetry, PATHS, 15), telemetry.window(n=15)
    assert expected.tick.tolist() == list(range(6, 21))
    as_json, as_arrow = found.as_json(), arrow(found.as_arrow())
    assert as_json["tick"] == as_arrow["tick"] == expected.tick.tolist()
    assert as_json["time_ns"] == as_arrow["time_ns"] == [tick * 1_000_000 for tick in range(6, 21)]
    assert list(as_json["values"]) == list(PATHS) == list(as_arrow)[2:]
    for path in PATHS:
        assert same(as_json["values"][path], expected[path]), path
        assert same(np.array(as_arrow[path]).reshape(expected[path].shape), expected[path]), path
    assert as_json["values"]["hold.state.big"] == [2**64 - 1 - tick for tick in range(6, 20)] + [2**64 - 20]
    assert as_json["values"]["machine.state"] == ["RUN"] * 14 + ["WAIT"]
    assert not same(as_json["values"]["hold.state.p"], np.nextafter(expected["hold.state.p"], 9))  # a control
    assert not same([0.0], [-0.0]) and same([math.nan], [math.nan])


def test_windows_over_http(supervisor: Supervisor, library: str) -> None:
    run = supervisor.start(library, paused=True, telemetry_fields=FIELDS)
    with VarClient(run["socket"]) as client:
        fly(client, 12)
        latest = client.get(*PATHS)
    asked = f"/runs/{run['id']}/windows?ticks=10&" + "&".join(f"path={path}" for path in PATHS)
    wait_until(lambda: supervisor.get(asked).json["tick"][-1:] == [12])
    as_json, answer = supervisor.get(asked).json, supervisor.get(asked, Accept=f"{ARROW}, */*;q=0.1")
    as_arrow = arrow(answer.body)
    assert answer.headers["Content-Type"] == ARROW
    assert as_json["tick"] == as_arrow["tick"] == list(range(3, 13)) and as_json["units"]["hold.state.p"] == ""
    for path in PATHS:
        assert same(numbers(as_json["values"][path]), as_arrow[path]), path
        one = np.float32 if "line" in path else np.asarray  # the variable server writes the shortest text of an f32
        assert same(one(numbers(as_json["values"][path])[-1]), one(latest[path])), path
    assert as_json["values"]["hold.inputs.free"][-2] == 5e-324
    assert as_json["values"]["hold.inputs.free"][:4] == [0.1, 0.0, 5e-324, "nan"]
    parts = ["p", "cube", *(f"p[{i}]" for i in range(4)), *(f"cube[{i}]" for i in range(2))]
    parts += [f"cube[{i}][{j}]" for i in range(2) for j in range(3)]
    refused = supervisor.get(
        f"/runs/{run['id']}/windows?ticks=10000&{'&'.join(f'path=hold.state.{part}' for part in parts)}"
    )
    assert (refused.status, refused.code) == (413, "too_large")  # 112 scalars of each tick
    assert refused.json["error"]["hint"] == f"ticks={1_000_000 // 112}"
    supervisor.ask("DELETE", f"/runs/{run['id']}")
    assert supervisor.get(asked).json == as_json  # and stays when the run has ended


def test_values_of_a_run_that_has_ended_are_as_while_it_ran(supervisor: Supervisor, library: str) -> None:
    """Fields, parts of one, structs, instances and other groups, of all of which every field was sent."""
    run = supervisor.start(library, paused=True, telemetry_fields="*")
    at = f"/runs/{run['id']}"
    with VarClient(run["socket"]) as client:
        fly(client, 12)
    wait_until(lambda: supervisor.get(f"{at}/windows?path=machine.tick").json["tick"][-1:] == [12])
    paths = ["hold", "hold.state", "hold.state.p", "hold.state.p[1]", "hold.inputs.free", "machine", "machine.state"]
    asked = f"{at}/values?" + "&".join(f"path={path}" for path in paths)
    running = supervisor.get(asked).json
    supervisor.ask("DELETE", at)
    ended = supervisor.get(asked).json
    for found in (running, ended):  # the variable server writes the shortest text of an f32
        for group, line in (("hold", "state.line"), ("hold.state", "line")):
            found["values"][group][line] = np.float32(found["values"][group][line]).tolist()
    assert ended == running
    assert running["tick"] == 13 and "state.p" in running["values"]["hold"]
    group = supervisor.get(f"{at}/windows?path=machine&path=machine.state&ticks=2").json["values"]
    assert group == {"machine.tick": [12, 13], "machine.state": ["RUN", "WAIT"], "machine.next_state": ["RUN", "WAIT"]}
    for part in ("p[1,:]", "p[-1]"):
        refused = supervisor.get(f"{at}/values?path=hold.state.{part}")
        assert (refused.status, refused.code) == (404, "unknown_path")
        assert "while the run is running" in refused.json["error"]["hint"]


def test_a_window_is_bounded() -> None:
    with Telemetry() as telemetry:
        for ticks in (0, 10_001):
            with pytest.raises(HttpError, match="ticks"):
                cut(telemetry, ["x"], ticks)
        with pytest.raises(HttpError, match="no telemetry") as refused:
            cut(telemetry, ["x"], 1)
        assert refused.value.status == 409


def families(body: bytes) -> dict[str, Any]:
    return {family.name: family for family in text_string_to_metric_families(body.decode())}


def test_metrics(supervisor: Supervisor, library: str) -> None:
    run = supervisor.start(library, paused=True, telemetry_fields="machine.*")
    ended = supervisor.start(library, ticks=3, rate="max")
    wait_until(lambda: supervisor.get(f"/runs/{ended['id']}").json["status"] == "ended")
    with VarClient(run["socket"]) as client:
        client.tick(50)
        client.inject("hold", "fault")
        client.tick(1)
        stats = client.stats()
    asked = f"/runs/{run['id']}/windows?ticks=100&path=machine.tick"
    wait_until(lambda: supervisor.get(asked).json["tick"][-1:] == [50])
    answer = supervisor.get("/metrics")
    assert answer.headers["Content-Type"] == "text/plain; version=0.0.4; charset=utf-8"
    found = families(answer.body)

    def value(name: str, **labels: str) -> float:
        samples = [sample for family in found.values() for sample in family.samples if sample.name == f"fcsl_{name}"]
        (sample,) = [sample for sample in samples if labels.items() <= sample.labels.items()]
        return float(sample.value)

    mine = {"run": run["id"], "kind": "flight"}
    assert value("run_up", **mine) == 1 and value("run_up", run=ended["id"]) == 0
    assert value("runs", status="running") == 1 and value("runs", status="ended") >= 1
    assert (
        value("run_ticks_total", **mine) == value("run_tick", **mine) == 51 and value("run_faults_total", **mine) == 1
    )
    assert value("run_paused", **mine) == 1 and value("run_health", **mine) == 2
    assert value("run_telemetry_packets_total", **mine) + value("run_telemetry_overwritten", **mine) == 51
    for name in (
        "deadlines_missed",
        "ticks_skipped",
        "watchdog_trips",
        "overruns",
        "hardware_failures",
        "messages_refused",
        "records_dropped",
    ):
        assert value(f"run_{name}_total", **mine) == stats[name]
    assert (
        found["fcsl_run_tick_time_seconds"].type == "histogram" and found["fcsl_run_deadlines_missed"].type == "counter"
    )
    check_histogram(found["fcsl_run_tick_time_seconds"], run["id"], stats["tick_time_ns"])
    assert value("run_lateness_seconds_count", **mine) == 0  # no tick of this run was paced by the clock
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_metrics_of_lost_requests(supervisor: Supervisor, root: Path, tmp_path: Path) -> None:
    folder = root / "craft"
    folder.mkdir()
    shutil.copy(build_machine(write(tmp_path)).library, folder / "craft.so")
    run = supervisor.start("craft/craft.so", paused=True)
    with VarClient(run["socket"]) as client:
        client.set(BOTH)
        client.tick(2)
    samples = families(supervisor.get("/metrics").body)["fcsl_run_lost_requests"].samples
    (lost,) = [sample for sample in samples if sample.labels["run"] == run["id"]]
    assert (lost.name, lost.value) == ("fcsl_run_lost_requests_total", 2)
    assert lost.labels["transition"] == "HOVER -> SAFE: ABORT"
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_verdicts_on_requirements(supervisor: Supervisor, root: Path, tmp_path: Path) -> None:
    folder = root / "watched"
    folder.mkdir()
    required = [{"id": "LOW-1", "text": "x is low.", "then": "src.outputs.x < 2.0"}]
    shutil.copy(build_machine(machine(tmp_path, required)).library, folder / "craft.so")
    run = supervisor.start("watched/craft.so", paused=True)
    with VarClient(run["socket"]) as client:
        for x in (3.0, 0.0, 3.0):
            client.set({"src.outputs.x": x})
            client.tick(2)
    samples = families(supervisor.get("/metrics").body)["fcsl_run_requirement_violations"].samples
    (found,) = [sample for sample in samples if sample.labels["run"] == run["id"]]
    assert (found.labels["requirement"], found.value) == ("LOW-1", 2)
    verdict = supervisor.get(f"/runs/{run['id']}/requirements").json["LOW-1"]
    assert (verdict["status"], verdict["exercised"], verdict["first_tick"]) == ("violated", 6, 0)
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_events_of_algorithms(supervisor: Supervisor, root: Path, tmp_path: Path) -> None:
    shutil.copy(build_machine(reporting(tmp_path)).library, root / "reporting.so")
    run = supervisor.start("reporting.so", paused=True)
    with VarClient(run["socket"]) as client:
        assert supervisor.get(f"/runs/{run['id']}/events").json == {"told": 0, "suppressed": 0, "lost": 0, "last": []}
        client.set({"a.inputs.gate": 3})
        client.tick()
        events = supervisor.get(f"/runs/{run['id']}/events").json
    assert events["last"][0]["message"] == "gate passed 3 0 true" and events["told"] == len(events["last"]) == 3
    supervisor.ask("DELETE", f"/runs/{run['id']}")
    shutil.copy(build_machine(machine(tmp_path, [])).library, root / "silent.so")
    other = supervisor.start("silent.so", paused=True)
    assert supervisor.get(f"/runs/{other['id']}/events").json == {}
    supervisor.ask("DELETE", f"/runs/{other['id']}")


def test_times_of_instances(
    supervisor: Supervisor, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = write(tmp_path)
    shutil.copy(build_machine(config).library, root / "plain.so")
    monkeypatch.setenv("FCSL_TIMES", "1")
    shutil.copy(build_machine(config).library, root / "measured.so")
    run = supervisor.start("measured.so", paused=True)
    with VarClient(run["socket"]) as client:
        client.tick(5)
    times = supervisor.get(f"/runs/{run['id']}/times").json
    assert times["machine"]["runs"] == 5 and times["machine"]["total_ns"] > 0
    found = families(supervisor.get("/metrics").body)
    for name, of in (("runs", lambda row: row["runs"]), ("seconds", lambda row: row["total_ns"] / 1e9)):
        samples = [s for s in found[f"fcsl_run_instance_{name}"].samples if s.labels["run"] == run["id"]]
        assert {s.labels["instance"]: s.value for s in samples} == {
            instance: of(row) for instance, row in times.items()
        }
    supervisor.ask("DELETE", f"/runs/{run['id']}")
    other = supervisor.start("plain.so", paused=True)
    assert supervisor.get(f"/runs/{other['id']}/times").json == {}
    supervisor.ask("DELETE", f"/runs/{other['id']}")


def check_histogram(family: Any, run: str, times: dict[str, Any]) -> None:
    """Against the finer one of the variable server: cumulative, whole, and each bucket holds what it says."""
    samples = [sample for sample in family.samples if sample.labels["run"] == run]
    buckets = {float(s.labels["le"]): s.value for s in samples if s.name.endswith("_bucket")}
    ends = sorted(buckets)
    assert [buckets[end] for end in ends] == sorted(buckets.values()) and ends[-1] == math.inf
    assert buckets[math.inf] == times["count"] == 51 == sum(count for _, count in times["buckets"])
    for end in ends:
        assert buckets[end] == sum(count for last, count in times["buckets"] if last / 1e9 <= end)
    assert min(b for b in ends if buckets[b] == 51) >= times["max"] / 1e9 / 2
    total = next(s.value for s in samples if s.name.endswith("_sum"))
    assert 0 < total <= times["max"] * 51 / 1e9


def test_a_value_at_the_end_of_a_bucket_is_in_it() -> None:
    """The finer buckets that end with a power of two, the largest one's exact maximum, and none between."""
    times = {"max": 600, "buckets": [[254, 1], [255, 2], [256, 4], [511, 8], [512, 16], [607, 32]]}
    rows, sum_s = metrics.cumulative(times)
    below = dict(rows)
    assert [below[repr(end / 1e9)] for end in (255, 511, 1023)] == [3, 15, 63] and below["+Inf"] == 63
    assert sum_s == (254 + 2 * 255 + 4 * 256 + 8 * 511 + 16 * 512 + 32 * 600) / 1e9


def test_the_parser_finds_what_is_wrong(supervisor: Supervisor) -> None:
    """A control of test_metrics: a page that is not in the format does not pass."""
    body = supervisor.get("/metrics").body
    assert b"fcsl_runs" in body
    with pytest.raises(ValueError):
        families(body + b'fcsl_run_up{run="1" 1\n')


def test_every_reply_is_json_that_round_trips(supervisor: Supervisor, library: str) -> None:
    run = supervisor.start(library, paused=True)
    with VarClient(run["socket"]) as client:
        client.set({"hold.inputs.free": 0.1 + 0.2, "hold.state.p[0,0]": math.nan}, allow_non_finite=True)
    answer = supervisor.get(f"/runs/{run['id']}/values?path=hold.inputs.free&path=hold.state.p[0,:2]&path=hold.state")
    assert b"NaN" not in answer.body
    assert json.loads(answer.body, parse_constant=pytest.fail)["values"]["hold.inputs.free"] == 0.1 + 0.2
    assert answer.json["values"]["hold.state.p[0,:2]"] == ["nan", 0.0]
    supervisor.ask("DELETE", f"/runs/{run['id']}")
