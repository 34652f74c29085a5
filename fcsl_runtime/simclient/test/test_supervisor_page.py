# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: a person starts a run, sees its values and its states move, and stops it.

Without a Chromium (Debian: `apt-get install chromium`) these tests are skipped.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterator
from pathlib import Path
from shutil import copy
from typing import Any

import pytest
from browser import CHROMIUM, Page, browsing
from supervising import Supervisor, supervising
from test_requirements import machine
from vars_machine import build

from fcsl_compiler.driver.cache import build_machine
from simclient import VarClient

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium here; the page is not tried in a browser")

#: What a run can bring into the page that would be HTML, were it not text.
HOSTILE = "<img src=x onerror=alert(1)><script>alert(2)</script>"
#: Updates per second that a busy machine may show, of 10.
RATE_MIN, RATE_MAX = 2.0, 14.0
#: Seconds that the newest drawn tick of a busy machine may be behind the flight.
BEHIND_MAX_S = 3.0


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    build(folder)
    return folder


@pytest.fixture(scope="module")
def library(root: Path) -> str:
    (library,) = root.glob("*.so")
    return library.name


@pytest.fixture(scope="module")
def supervisor(root: Path) -> Iterator[Supervisor]:
    with supervising(root) as supervisor:
        yield supervisor


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with browsing(tmp_path_factory.mktemp("browser")) as page:
        yield page


@pytest.fixture
def page(browser: Page, supervisor: Supervisor) -> Iterator[Page]:
    """The page, opened; in the end nothing was thrown, and no policy was hurt."""
    browser.complaints.clear()
    browser.open(f"http://127.0.0.1:{supervisor.port}/?")
    browser.open(f"http://127.0.0.1:{supervisor.port}/")
    live(browser)
    yield browser
    assert browser.complaints == []


def live(page: Page) -> None:
    page.wait("document.querySelector('#link')?.innerText === 'live'")


def start(page: Page, file: str, options: str) -> None:
    page.fill("#file", file)
    page.fill("#options", options)
    page.click("#start button")


def choose(page: Page, name: str) -> None:
    page.click(f'#values label[title="{name}"] input')


def behind_s(page: Page, client: VarClient) -> float:
    """Seconds from the newest tick in the picture to the machine's, which is asked for afterwards."""
    drawn = page.run(
        "new Promise((done) => requestAnimationFrame(() => done(Number(document.querySelector('#pictures').dataset.drawn))))"
    )
    return float(client.get("machine.tick")["machine.tick"]) / 1000 - drawn


def pixels(page: Page, selector: str) -> Any:
    return page.run(f"document.querySelector('{selector}').toDataURL()")


def test_a_run_from_its_start_to_its_end(page: Page, supervisor: Supervisor, library: str) -> None:
    start(page, library, '{"telemetry_fields": "hold.*,machine.*"}')
    choose(page, "hold.state.count")
    choose(page, "hold.state.p[1][2]")
    run = supervisor.get("/runs").json["runs"][-1]["id"]
    page.wait("Number(document.querySelector('#rate').innerText) > 0")
    # The machine has a state in which one instance is stale, and is nominal all the same.
    page.wait("document.querySelector('#rows tr.chosen').cells[6].innerText === 'nominal'")
    before = pixels(page, ".panel canvas")
    page.wait("Number(document.querySelector('.panel output').innerText) > 2000")
    assert pixels(page, ".panel canvas") != before
    assert page.text("#band") == "" and "state RUN" in page.run("document.querySelector('#band').ariaLabel")
    counted = page.run(
        "new Promise((done) => { const seen = new Set(); const begun = performance.now();"
        " const look = () => { seen.add(document.querySelector('#pictures').dataset.drawn);"
        " performance.now() - begun < 3000 ? requestAnimationFrame(look) : done(seen.size / 3); }; look(); })"
    )
    assert RATE_MIN < counted < RATE_MAX
    with VarClient(supervisor.get(f"/runs/{run}").json["socket"]) as client:
        behind = sorted(behind_s(page, client) for _ in range(50))
        print(
            f"{counted:.1f} pictures/s; behind the flight: median {statistics.median(behind):.3f} s, most {behind[-1]:.3f} s"
        )
        assert behind[-1] < BEHIND_MAX_S
        client.set_state("WAIT")
        page.wait("document.querySelector('#band').ariaLabel.startsWith('state WAIT')")
        page.wait("document.querySelector('#instances').innerText.includes('hold: stale')")
        page.wait("document.querySelector('.panel output').innerText === '–'")  # an old value is not shown
        page.wait("document.querySelector('#rows tr.chosen').cells[6].innerText === 'nominal'")
    page.click(f'button[aria-label="stop run {run}"]')
    page.wait("document.querySelector('#rows tr.chosen').cells[4].innerText.startsWith('ended: 0')")
    page.click("#printed summary")
    page.wait("document.querySelector('#log').innerText.includes(' ticks, ')")
    assert supervisor.get(f"/runs/{run}").json["status"] == "ended"


def test_requirements_are_shown_with_their_verdicts(
    page: Page, supervisor: Supervisor, root: Path, tmp_path: Path
) -> None:
    required = [
        {"id": "LOW-1", "text": HOSTILE, "then": "src.outputs.x < 2.0"},
        {"id": "LOW-2", "text": "y is low.", "then": "src.outputs.y < 2.0"},
    ]
    copy(build_machine(machine(tmp_path, required)).library, root / "watched.so")
    run = supervisor.start("watched.so", paused=True)
    with VarClient(run["socket"]) as client:
        client.tick(3)
        page.run(f"location.hash = '{run['id']}'")
        cells = "[...document.querySelectorAll('#requirements tbody tr')].map((row) => [...row.cells].map((c) => c.innerText))"
        row = ["LOW-1", "met", "3", "0", "", "", HOSTILE]
        page.wait(f"JSON.stringify({cells}[0]) === JSON.stringify({json.dumps(row)})")
        client.set({"src.outputs.x": 3.0})
        client.tick()
        row[1:6] = "violated", "4", "1", "3", "src.outputs.x = 3"
        page.wait(f"JSON.stringify({cells}[0]) === JSON.stringify({json.dumps(row)})")
        assert page.run(f"{cells}[1][1]") == "met"
        choose(page, "src.outputs.x")
        page.wait("document.querySelector('#band').ariaLabel.endsWith(', LOW-1 violated')")
        band = "[251, 220, 218, 255]"
        page.wait(
            "(() => { const canvas = document.querySelector('.panel canvas');"
            " const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
            f" return data.some((_, i) => i % 4 === 0 && {band}.every((part, k) => data[i + k] === part)); }})()"
        )
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_times_of_instances_are_shown(
    page: Page, supervisor: Supervisor, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FCSL_TIMES", "1")
    copy(build_machine(machine(tmp_path, [])).library, root / "measured.so")
    run = supervisor.start("measured.so", paused=True)
    with VarClient(run["socket"]) as client:
        client.tick(3)
        page.run(f"location.hash = '{run['id']}'")
        cells = "[...document.querySelectorAll('#times tbody tr')].map((row) => [...row.cells].map((c) => c.innerText))"
        page.wait(f"{cells}.length === 4 && {cells}[3][1] === '3'")
        rows = page.run(cells)
        assert {row[0]: row[1] for row in rows} == {"src": "3", "slow": "1", "other": "3", "step": "3"}
        assert rows[3][0] == "step" and rows[3][6] == "100.0 %" and all(row[2].endswith(" µs") for row in rows)
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_ticks_of_violations_are_those_that_two_verdicts_show(page: Page) -> None:
    verdicts = [(1, 3, 12), (1, 5, 14), (2, 6, 20), (5, 11, 40), (5, 11, 40), (1, 3, 12)]
    shown = [{"violations": n, "violated_ticks": ticks, "last_tick": last} for n, ticks, last in verdicts]
    found = page.run(
        f"import('/requirements.js').then(({{ violatedTicks }}) => {json.dumps(shown)}.map((now, i, all) =>"
        " violatedTicks(all[i - 1] ?? { violations: 0, violated_ticks: 0 }, now)))"
    )
    spans = [one and (one["first"], one["last"], one["continues"]) for one in found]
    assert spans == [(10, 12, False), (13, 14, True), (20, 20, False), (40, 40, False), None, None]


def test_what_is_refused_is_said(page: Page) -> None:
    start(page, "nothing.so", "")
    page.wait("document.querySelector('#error').innerText.includes('nothing.so')")
    start(page, "nothing.so", '{"paused"}')
    page.wait("document.querySelector('#error').innerText.includes('write a JSON object')")
    page.run("location.hash = '99'")
    page.wait("document.querySelector('#error').innerText.includes(\"no run '99'\")")
    live(page)


def test_hostile_names_are_text(page: Page, root: Path, library: str) -> None:
    """A library's name. Slashes are folders, so it has none."""
    name = HOSTILE.replace("/", "") + ".so"
    (root / name).write_bytes((root / library).read_bytes())
    start(page, name, '{"paused": true}')
    page.wait("document.querySelector('#rows tr.chosen') !== null")
    page.wait(f"document.querySelector('#title').innerText.includes({name!r})")
    assert name in page.text("#rows")
    assert page.run("document.querySelectorAll('img, script:not([src])').length") == 0
    page.click("#rows tr.chosen button")


def test_views_are_shown_without_a_choice(page: Page, supervisor: Supervisor, library: str) -> None:
    """`views` of a run, as its description has it; what is not sent or not a view is left out. Texts stay texts."""
    panels = [
        {"title": HOSTILE, "estimate": ["hold.state.line[0]"], "truth": ["hold.outputs.y"], "values": ["hold.nothing", 7]},
        {"title": "empty", "values": ["nothing"]}, {"title": "odd", "values": "x"}, None,
    ]  # fmt: skip
    described = json.dumps({"views": {"panels": panels}, "log": [HOSTILE]})
    page.run(
        "const given = Response.prototype.json; Response.prototype.json = async function () {"
        f" const found = await given.call(this); return found.log ? {{ ...found, ...{described} }} : found; }}"
    )
    run = supervisor.start(library, paused=True, telemetry_fields="hold.*,machine.*")["id"]
    page.run(f"location.hash = '{run}'")
    page.wait("document.querySelectorAll('.panel').length === 1")
    assert page.text(".panel figcaption span") == HOSTILE
    names = "[...document.querySelectorAll('.legend .name')].map((name) => name.innerText)"
    assert page.run(names) == ["hold.outputs.y", "hold.state.line[0]"]
    assert page.run("document.querySelector('#log').textContent") == HOSTILE
    page.click(".panel figcaption button")
    page.wait("document.querySelectorAll('.panel').length === 0 && !document.querySelector('#hint').hidden")
    supervisor.ask("DELETE", f"/runs/{run}")


def test_views_of_attitudes_are_three_panels(page: Page) -> None:
    channels = json.dumps({"body.outputs.q": {"shape": [4], "unit": "", "labels": []},
                           "nav.outputs.pose.q": {"shape": [4], "unit": "", "labels": []},
                           "nav.outputs.short": {"shape": [3], "unit": "", "labels": []}})  # fmt: skip
    panel = {
        "title": "attitude",
        "angles": True,
        "truth": ["body.outputs.q"],
        "estimate": ["nav.outputs.pose.q", "nav.outputs.short"],
    }
    found = page.run(
        f"import('/channels.js').then(({{ numbersOf, panelsOf }}) => panelsOf({json.dumps({'panels': [panel]})},"
        f" numbersOf({channels})))"
    )
    assert [one["title"] for one in found] == ["attitude: roll", "attitude: pitch", "attitude: yaw"]
    assert [(curve["name"], curve["role"], curve["quaternion"]) for curve in found[2]["curves"]] == [
        ("body.outputs.q.yaw", "truth", "body.outputs.q"),
        ("nav.outputs.pose.q.yaw", "estimate", "nav.outputs.pose.q"),
    ]


def test_points_that_come_again_replace_those_that_are_there(page: Page) -> None:
    """As another choice of values makes them come, or a checkpoint that puts the machine back."""
    update = {"session": "1", "first": True, "breaks": [], "states": [[0, "RUN"]]}
    updates = json.dumps([
        {**update, "time_s": [0, 1, 2], "values": {"a": [0, 1, 2]}},
        {**update, "time_s": [1, 2, 3], "values": {"a": [10, 20, 30], "b": [5, 6, 7]}, "states": [[1, "RUN"]]},
        {**update, "time_s": [2.5], "values": {"b": [8]}, "states": [[2.5, "WAIT"]]},
        {**update, "time_s": [9, 10], "values": {"b": [1, 2]}, "states": [[9, "WAIT"]], "breaks": [1]},
    ])  # fmt: skip
    found = page.run(
        f"import('/series.js').then(({{ Series }}) => {{ const series = new Series(); {updates}.forEach((one) =>"
        " series.add(one)); return [series.time, [...series.columns], series.gap, series.states]; })"
    )
    assert found == [
        [0, 1, 2, 2.5, 9, 10],
        [["a", [0, 10, 20, None, None, None]], ["b", [None, 5, 6, 8, 1, 2]]],
        [False, False, False, False, True, True],
        [[0, "RUN"], [2.5, "WAIT"]],
    ]


def test_a_token_is_asked_for(browser: Page, root: Path, library: str, tmp_path: Path) -> None:
    with supervising(root, "--token", str(tmp_path / "token")) as supervisor:
        browser.open(f"http://127.0.0.1:{supervisor.port}/")
        for token, then in (
            ("0123456789abcdef", "document.querySelector('#link').innerText.includes('token')"),
            ((tmp_path / "token").read_text(), "document.querySelector('#link').innerText === 'live'"),
        ):
            browser.wait("document.querySelector('#unlock') !== null && !document.querySelector('#unlock').hidden")
            browser.fill("#token", token.strip())
            browser.click("#unlock button")
            browser.wait(then)
        start(browser, library, '{"paused": true}')
        browser.wait("document.querySelector('#rows tr.chosen') !== null")
        assert (
            browser.run("[localStorage.length, sessionStorage.length, document.cookie, location.search].join()")
            == "0,0,,"
        )
