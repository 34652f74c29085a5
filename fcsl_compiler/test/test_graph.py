# SPDX-License-Identifier: Apache-2.0
"""Pictures of machines: complete, legible by measure, and those of the examples are what their machines say.

FCSL_UPDATE_GOLDEN=1 rewrites the examples' pictures: look at them.
"""

import os
import random
import re
from itertools import combinations, permutations
from pathlib import Path
from xml.etree import ElementTree

import pytest
from test_golden import CONFIG, golden
from test_parts import write as write_parts

from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.graph import render
from fcsl_compiler.graph.fold import fold
from fcsl_compiler.graph.layout import STUB, Layout, Placed, Point, lay_out, tag_width
from fcsl_compiler.graph.model import Box, Picture, Row, Wire, dataflow, legend, state_machine
from fcsl_compiler.graph.svg import draw
from fcsl_compiler.model.machine import Machine

EXAMPLES = Path(__file__).parents[2] / "examples"
#: Example machines, each with its picture in the folder of its README.
PICTURES = {
    "minimal/minimal.json": "minimal/minimal.svg",
    "ahrs/ahrs.json": "ahrs/ahrs.svg",
    "arming/arming.json": "arming/arming.svg",
    "lander/fc/lander_control.json": "lander/lander_control.svg",
    "glider/fc/glider.json": "glider/glider.svg",
    "inverted_pendulum/fc/inverted_pendulum.json": "inverted_pendulum/inverted_pendulum.svg",
    "quadrotor/fc/quadrotor.json": "quadrotor/quadrotor.svg",
    "rocket_landing/fc/rocket_landing.json": "rocket_landing/rocket_landing.svg",
    "rover/fc/rover.json": "rover/rover.svg",
    "satellite/fc/satellite.json": "satellite/satellite.svg",
    "thermal_guard/thermal_guard.json": "thermal_guard/thermal_guard.svg",
}
BOXES = (
    "lander/fc/filter_alone.json",
    "quadrotor/sim/pilot.json",
    "inverted_pendulum/sim/operator.json",
    "rover/sim/driver.json",
)
MACHINES = {"small": CONFIG, **{Path(p).stem: EXAMPLES / p for p in PICTURES}}


def machine(path: Path) -> Machine:
    return compile_machine(path, "", until="schedule").checked


@pytest.mark.parametrize("config", PICTURES)
def test_the_examples_pictures_are_current(config: str) -> None:
    picture = EXAMPLES / PICTURES[config]
    text = render(machine(EXAMPLES / config), None, ".svg")
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        picture.write_text(text)
    assert picture.read_text() == text, "the machine changed; FCSL_UPDATE_GOLDEN=1 draws it anew"
    assert f"({picture.name})" in (picture.parent / "README.md").read_text()


def test_every_example_has_a_picture() -> None:
    """Except those with a single box: the lander's filter alone, for a test, and the quadrotor's pilot, a model."""
    configs = [p for p in EXAMPLES.rglob("*.json") if '"states"' in p.read_text()]
    assert {str(p.relative_to(EXAMPLES)) for p in configs} == {*PICTURES, *BOXES}


@pytest.mark.parametrize("path", MACHINES.values(), ids=MACHINES)
def test_nothing_is_left_out(path: Path) -> None:
    """In both formats: instances, ports, units, channels, sources, rates, states, requests, guards. Requirements that act
    are in the picture of the states alone."""
    m = machine(path)
    own = [i for n, i in enumerate(m.instances) if n not in m.acting]
    pictures = [dataflow(m), state_machine(m)]
    svg, mermaid = render(m, None, ".svg"), render(m, None, ".mmd")
    words = [i.name for i in own] + [s.name for s in m.states] + [c.name for c in m.channels]
    words += [m.requests[e.request] for e in m.edges if e.request >= 0] + ["initial"]
    guarded = [e for e in m.edges if e.guard_instance >= 0]
    words += [f"requirement {e.requirement}" for e in guarded if e.requirement]
    words += [f"{m.instances[e.guard_instance].name} failed" for e in guarded if not e.requirement]
    words += [effect.requirement for effect in m.effects]
    for word in words:
        assert word in svg and word in mermaid, word
    for i in own:
        for port in i.algorithm.ports["inputs"]:
            assert f">{port.name}<" in svg and f">{f'{port.type} {port.unit}'.strip()}<" in svg
    wires = [w for w in pictures[0].wires if pictures[0].boxes[w.target].kind == "instance"]
    assert len(wires) == sum(c.source.instance >= 0 for c in m.connections)
    delayed = sum(w.dashed for w in wires)
    assert delayed == sum(c.delayed for c in m.connections) == svg.count("stroke-dasharray") - (delayed > 0)
    tags = [row.tag for box in pictures[0].boxes for row in box.rows if row.tag]
    of_machine = sum(t.startswith(("machine.", "channels.")) for t in tags)
    assert of_machine == sum(c.source.instance < 0 for c in m.connections)
    fed = {(c.target.instance, c.target.field) for c in m.connections}
    inputs = [(n, p.name) for n, i in enumerate(own) for p in i.algorithm.ports["inputs"]]
    assert tags.count("host") == len([i for i in inputs if i not in fed])
    for state in m.states:
        boxes = [box for box in pictures[1].boxes if box.name == state.name or box.kind == "always"]
        rows = [(row.left, row.left_note) for box in boxes for row in box.rows if row.left]
        rates = [row for row in rows if row[0] != "requirement"]
        due = [e.instance for e in state.entries if e.instance not in m.acting]
        assert sorted(name for name, _ in rates) == sorted(m.instances[n].name for n in due)
        assert all("Hz" in rate or "ticks" in rate for _, rate in rates)


def test_what_every_state_schedules_is_listed_once() -> None:
    picture = state_machine(machine(EXAMPLES / "lander/fc/lander_control.json"))
    listed = {box.name: [row.left for row in box.rows if row.left] for box in picture.boxes if box.kind != "transition"}
    always = ["sensors", "monitor", "filter", "engine"]
    alone = {"ASCENT": ["ascent"], "COAST": ["coast"], "DESCENT": ["descent"], "SAFE": ["safe"]}
    assert listed == {**alone, "every state": always, "*": []}
    only = state_machine(machine(EXAMPLES / "minimal/minimal.json"))
    assert [box.kind for box in only.boxes].count("always") == (len(only.boxes) > 1)


def test_a_legend_has_the_signs_of_its_picture() -> None:
    m = machine(EXAMPLES / "lander/fc/lander_control.json")
    signs = {"instance", "channel", "machine", "wire", "dashed"}
    assert {sign for sign, _ in legend(dataflow(m))} == signs
    assert {sign for sign, _ in legend(dataflow(m, m.states[1]))} == signs | {"dim"}
    states = {"state", "always", "transition", "initial"}
    assert {sign for sign, _ in legend(state_machine(m))} == states
    assert {sign for sign, _ in legend(state_machine(m, m.states[1]))} == states | {"strong"}
    svg, mermaid = render(m, None, ".svg"), render(m, None, ".mmd")
    for meaning in (
        "connection delayed by a tick",
        "value of the machine itself",
        "instances that every state schedules",
    ):
        assert svg.count(meaning) == mermaid.count(meaning) == 1


@pytest.mark.parametrize("path", MACHINES.values(), ids=MACHINES)
def test_a_legend_lies_below_its_picture_and_within_the_width(path: Path) -> None:
    root = ElementTree.fromstring(render(machine(path), None, ".svg"))
    width, height = float(root.get("width", "0")), float(root.get("height", "0"))
    top = 0.0
    for picture in root:
        *_, signs = picture
        offset, below = (float(g.get("transform", "").split()[1].rstrip(")")) for g in (picture, signs))
        rects = [rect for rect in signs.iter() if rect.tag.endswith("rect")]
        assert rects and offset >= top
        top = offset + below
        for rect in rects:
            left, y, wide, tall = (float(rect.get(name, "0")) for name in ("x", "y", "width", "height"))
            assert left + wide <= width and offset + below + y + tall <= height


def test_calls_outside_are_named() -> None:
    m = machine(EXAMPLES / "thermal_guard/thermal_guard.json")
    for suffix in (".svg", ".mmd"):
        assert "calls cpu_temp_c, hw_write_gpio" in render(m, None, suffix)
        assert "calls" not in render(machine(CONFIG), None, suffix)


def test_a_folded_part_is_one_box(tmp_path: Path) -> None:
    """With what leaves and enters it; wires within it are gone, and no other."""
    machine = compile_machine(write_parts(tmp_path), "", until="schedule").checked
    whole, folded = dataflow(machine), fold(dataflow(machine))
    assert [box.name for box in folded.boxes] == ["body", "att", "spare", "u"]
    att = folded.boxes[1]
    assert att.subtitle == "2 instances"
    assert [row.left for row in att.rows] == ["law.angle", "law.target", "law.order", "rate.pi.rate"]
    assert [row.right for row in att.rows] == ["rate.pi.u", "rate.pi.pair.first", "", ""]
    inside = [w for w in whole.wires if "." in whole.boxes[w.source].name and "." in whole.boxes[w.target].name]
    assert len(folded.wires) == len(whole.wires) - len(inside) and len(inside) == 2
    for wire in folded.wires:
        assert (
            folded.boxes[wire.source].rows[wire.source_row].right
            and folded.boxes[wire.target].rows[wire.target_row].left
        )
    states = fold(state_machine(machine))
    shown = {box.name: [(row.left, row.left_note) for row in box.rows if row.left] for box in states.boxes}
    assert shown["FLY"] == [("spare", "at its own rates")]
    assert shown["every state"] == [("att", "at its own rates"), ("body", "1000 Hz")]
    assert all(wire.target_row < len(states.boxes[wire.target].rows) for wire in states.wires)
    ElementTree.fromstring(draw([folded, states]))


@pytest.mark.parametrize("path", MACHINES.values(), ids=MACHINES)
def test_a_machine_without_parts_is_drawn_as_before(path: Path) -> None:
    machine = compile_machine(path, "", until="schedule").checked
    assert render(machine, None, ".svg", folded=True) == render(machine, None, ".svg")


def test_mermaid() -> None:
    golden("small.mmd.txt", render(machine(CONFIG), None, ".mmd"))


def test_one_state() -> None:
    """The instances of the state and their sources, which are drawn faintly if they do not run."""
    m = machine(EXAMPLES / "lander/fc/lander_control.json")
    picture = dataflow(m, m.states[1])
    assert [(b.name, b.dim) for b in picture.boxes if b.kind == "instance"] == [
        ("sensors", False),
        ("monitor", False),
        ("filter", False),
        ("ascent", True),
        ("coast", False),
        ("descent", True),
        ("safe", True),
        ("engine", False),
    ]
    assert [b.name for b in state_machine(m, m.states[1]).boxes if b.strong] == ["COAST"]
    assert "not in COAST" in render(m, m.states[1], ".mmd")


def test_any_state_is_one_box() -> None:
    picture = state_machine(machine(EXAMPLES / "lander/fc/lander_control.json"))
    (any_state,) = [n for n, b in enumerate(picture.boxes) if b.kind == "any"]
    assert sum(w.source == any_state for w in picture.wires) == 2


# ---- legible -------------------------------------------------------------------------------------------------------

Rect = tuple[float, float, float, float]


def rects(p: Placed) -> list[Rect]:
    """The box and its tags: left, top, right, bottom."""
    assert p.box is not None
    found = [(p.x, p.y, p.x + p.width, p.y + p.height)]
    for n, row in enumerate(p.box.rows):
        if row.tag:
            left, y = p.x - STUB - tag_width(row.tag), p.row_y(n)
            found.append((left, y - 7, p.x, y + 7))
    return found


def overlap(a: Rect, b: Rect, by: float = 0.5) -> bool:
    return a[0] + by < b[2] and b[0] + by < a[2] and a[1] + by < b[3] and b[1] + by < a[3]


def segments(path: list[Point]) -> list[Rect]:
    return [
        (min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1]))
        for a, b in zip(path, path[1:], strict=False)
        if a != b
    ]


def on_one_line(a: Rect, b: Rect) -> bool:
    """Whether two straight segments overlap, not only cross."""
    flat = a[1] == a[3] and b[1] == b[3] and abs(a[1] - b[1]) < 1 and min(a[2], b[2]) - max(a[0], b[0]) > 0.5
    up = a[0] == a[2] and b[0] == b[2] and abs(a[0] - b[0]) < 1 and min(a[3], b[3]) - max(a[1], b[1]) > 0.5
    return flat or up


def check(layout: Layout) -> None:
    boxes = [(p, r) for p in layout.boxes for r in rects(p)]
    for (p, a), (q, b) in combinations(boxes, 2):
        assert p is q or not overlap(a, b), f"{p.box} lies on {q.box}"
    for _, (left, top, right, bottom) in boxes:
        assert left >= 0 and top >= 0 and right <= layout.width and bottom <= layout.height
    for wire, path in zip(layout.picture.wires, layout.paths, strict=True):
        source, target = layout.boxes[wire.source], layout.boxes[wire.target]
        assert path[0] == (source.x + source.width, source.row_y(wire.source_row))
        assert path[-1] == (target.x, target.row_y(wire.target_row))
        for a, b in zip(path, path[1:], strict=False):
            assert a[0] == b[0] or a[1] == b[1], "not at right angles"
        for piece in segments(path):
            assert all(0 <= piece[i] <= (layout.width, layout.height)[i % 2] for i in range(4))
            for p, r in boxes:
                assert not overlap((piece[0] - 0.5, piece[1] - 0.5, piece[2] + 0.5, piece[3] + 0.5), r, 1.0), p.box
    pairs = combinations(zip(layout.picture.wires, layout.paths, strict=True), 2)
    for (w, path), (v, other) in pairs:
        if (w.source, w.source_row) == (v.source, v.source_row):
            continue
        same_end = (w.target, w.target_row) == (v.target, v.target_row)
        for a in segments(path)[: -1 if same_end else None]:
            for b in segments(other)[: -1 if same_end else None]:
                assert not on_one_line(a, b), f"{w} runs on {v}"


@pytest.mark.parametrize("path", MACHINES.values(), ids=MACHINES)
def test_layout_of_machines(path: Path) -> None:
    m = machine(path)
    for state in (None, *m.states):
        check(lay_out(dataflow(m, state)))
        check(lay_out(state_machine(m, state)))


def random_picture(seed: int) -> Picture:
    rng = random.Random(seed)
    picture = Picture(f"random {seed}")
    for n in range(rng.randint(1, 18)):
        rows = [Row(f"in_{i}", "f64 m", f"out_{i}", "bool") for i in range(rng.randint(1, 6))]
        for row in rows:
            if rng.random() < 0.2:
                row.left, row.tag, row.tag_kind = "", "machine.dt" * rng.randint(1, 2), "machine"
        picture.boxes.append(Box(f"b{n}", "instance", f"box {n}", "some · 100 Hz", rows))
    free = [(n, i) for n, b in enumerate(picture.boxes) for i, row in enumerate(b.rows) if row.left]
    rng.shuffle(free)
    for target, row in free[: rng.randint(0, len(free))]:
        source = rng.randrange(len(picture.boxes))
        at = rng.randrange(len(picture.boxes[source].rows))
        picture.wires.append(Wire(source, at, target, row, rng.random() < 0.25))
    return picture


@pytest.mark.parametrize("seed", range(60))
def test_layout_of_random_pictures(seed: int) -> None:
    """Cycles, self-loops, long wires, boxes without wires."""
    layout = lay_out(random_picture(seed))
    check(layout)
    assert lay_out(random_picture(seed)).paths == layout.paths


def crossings(wires: list[tuple[float, float, float]]) -> int:
    """Of wires from the left at one height to a vertical, and from there to the right at another: (x, from, to)."""
    count = 0
    for (x, begin, end), (other_x, other_begin, other_end) in permutations(wires, 2):
        crossed = other_begin if x < other_x else other_end
        count += min(begin, end) < crossed < max(begin, end)
    return count


def test_no_swap_of_neighbours_removes_a_crossing() -> None:
    """Of the wires between two boxes with many ports."""
    rng = random.Random(2)
    for turn in range(400):
        ports = rng.randint(2, 9)
        picture = Picture(f"two {turn}")
        for name in "ab":
            rows = [Row(f"in_{i}", "f64", f"out_{i}", "f64") for i in range(ports)]
            picture.boxes.append(Box(name, "instance", name, "", rows))
        inputs = rng.sample(range(ports), ports)
        picture.wires = [Wire(0, output, 1, row, False) for output, row in enumerate(inputs)]
        wires = sorted((path[1][0], path[0][1], path[-1][1]) for path in lay_out(picture).paths)
        found = crossings(wires)
        for n in range(ports - 1):
            left, right = wires[n : n + 2]
            swapped = [(right[0], *left[1:]), (left[0], *right[1:])]
            assert crossings([*wires[:n], *swapped, *wires[n + 2 :]]) >= found, (inputs, n)


def test_a_large_machine_is_drawn_in_time() -> None:
    rng = random.Random(1)
    rows = [[Row(f"i{k}", "f64", f"o{k}", "f64") for k in range(10)] for _ in range(60)]
    picture = Picture("large", [Box(f"b{n}", "instance", f"b{n}", "", r) for n, r in enumerate(rows)])
    picture.wires = [Wire(rng.randrange(60), rng.randrange(10), n // 10, n % 10) for n in range(600)]
    assert draw([picture]).count("<path") >= 1200


@pytest.mark.parametrize("path", MACHINES.values(), ids=MACHINES)
def test_svg_is_xml_and_needs_nothing_else(path: Path) -> None:
    root = ElementTree.fromstring(render(machine(path), None, ".svg"))
    assert root.tag == "{http://www.w3.org/2000/svg}svg" and float(root.get("width", "0")) > 200
    for element in root.iter():
        assert "href" not in "".join(element.keys()) and not element.tag.endswith(("script", "style", "image"))


# ---- the command ---------------------------------------------------------------------------------------------------


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["graph", str(CONFIG)]) == 0
    mermaid = capsys.readouterr().out
    assert mermaid.startswith("flowchart LR\n")
    for name in ("a.svg", "b.mmd", "c.md"):
        assert main(["graph", str(CONFIG), "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "b.mmd").read_text() == mermaid
    assert (tmp_path / "c.md").read_text() == f"```mermaid\n{mermaid}```\n"
    assert (tmp_path / "a.svg").read_text().startswith("<svg ")
    assert main(["graph", str(CONFIG), "--state", "REST"]) == 0
    assert re.search(r"law.* not in REST", capsys.readouterr().out) is None


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["-o", "x.png"], 2, ".svg, .mmd, .md"),
        (["--state", "REZT"], 2, "did you mean `REST`?"),
        (["--state", "x"], 2, "the states are RUN, REST"),
        (["-o", "/dev/null/x.svg"], 1, "/dev/null"),
    ],
)
def test_usage(arguments: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["graph", str(CONFIG), *arguments]) == status
    err = capsys.readouterr().err
    assert message in err and err.startswith("fcslc: ")


def test_a_wrong_machine_is_not_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.json").write_text("{")
    assert main(["graph", str(tmp_path / "bad.json"), "-o", str(tmp_path / "x.svg")]) == 1
    assert "E101" in capsys.readouterr().err and not (tmp_path / "x.svg").exists()
