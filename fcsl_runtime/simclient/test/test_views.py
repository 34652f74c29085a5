# SPDX-License-Identifier: Apache-2.0
"""The `views` block as readers take it: from bags, telemetry and files, none of which is trusted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simclient.errors import ViewError
from simclient.view.views import (
    TEXT_BYTES_MAX,
    Body,
    Curve,
    Frame,
    PanelView,
    Views,
    parse_views,
    read_views,
    views_or_remark,
)

PANEL = {"title": "a", "angles": False, "estimate": ["nav.outputs.x", "nav.outputs.p[1].v[2]"], "truth": ["b.state.y"]}
BODY = {"shape": "lander", "size": 3.0, "position": [0, 0.5, "nav.outputs.z"], "thrust": "e.outputs.f", "up": "+z"}


def test_a_block_becomes_panels_and_a_body() -> None:
    curves = Curve("b.state.y", "truth"), Curve("nav.outputs.x", "estimate"), Curve("nav.outputs.p[1].v[2]", "estimate")
    body = Body("lander", 3.0, (0.0, 0.5, "nav.outputs.z"), "", "e.outputs.f", "+z", "")
    assert parse_views(json.dumps({"panels": [PANEL], "body": BODY})) == Views((PanelView("a", False, curves),), body)


def test_defaults_are_those_of_the_compiler() -> None:
    for shape, size in (("lander", 3.0), ("rover", 1.0)):
        views = parse_views(json.dumps({"panels": [PANEL], "body": {"shape": shape, "attitude": "a.outputs.q"}}))
        assert views.body == Body(shape, size, (), "a.outputs.q", "", "+z", "")
    assert parse_views(json.dumps({"panels": [PANEL]})).body is None


def test_frames_have_defaults_too() -> None:
    placed = {"frame": "imu", "parent": "base", "position": [1, 2, 3], "rotation": [0.0, 1.0, 0.0, 0.0]}
    views = parse_views(json.dumps({"panels": [PANEL], "frames": [placed, {"frame": "a", "parent": "b"}]}))
    identity = Frame("a", "b", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    assert views.frames == (Frame("imu", "base", (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)), identity)


def with_frame(**changes: Any) -> str:
    return json.dumps({"panels": [PANEL], "frames": [{"frame": "imu", "parent": "base", **changes}]})


def with_panel(**changes: Any) -> str:
    return json.dumps({"panels": [{**PANEL, **changes}]})


def with_body(**changes: Any) -> str:
    return json.dumps({"panels": [PANEL], "body": {**BODY, **changes}})


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not valid JSON"),
        ("{" * 60000, "not valid JSON|nested too deeply"),
        ("[" * 60000, "nested too deeply|not valid JSON"),
        (" " * (TEXT_BYTES_MAX + 1), "more than 65535 bytes"),
        ("7", r"views: not an object with panels, body"),
        ("{}", "holds neither"),
        (with_frame(position=[1, 2]), r"views.frames\[0\]: a position has 3 numbers, a rotation 4"),
        (with_frame(rotation=[1, 0, 0, "x"]), r"views.frames\[0\].rotation: not a number"),
        (with_frame(frame=7), r"views.frames\[0\].frame"),
        ('{"panels": [], "panels": []}', "a key appears twice"),
        ('{"pannels": []}', "no key `pannels`; did you mean `panels`"),
        (json.dumps({"panels": [PANEL] * 17}), r"views.panels: 17 elements; at most 16"),
        (json.dumps({"panels": PANEL}), "views.panels: not a list"),
        (json.dumps({"panels": [{"title": "x"}]}), r"views.panels\[0\]: has no curve"),
        (with_panel(title="a\nb"), r"panels\[0\].title: not a text"),
        (with_panel(title="x" * 999), "title: not a text of at most"),
        (with_panel(angles=1), "angles: not true or false"),
        (with_panel(colour="red"), "no key `colour`"),
        (with_panel(**{"\x1b[2J\n": 1}), r"no key `'\\x1b\[2J\\n'`"),
        (with_panel(command=["a.outputs.x"] * 9), "command: 9 elements"),
        (with_panel(command=["a.outputs.x"] * 6), r"panels\[0\]: 9 curves; at most 8"),
        (with_panel(truth=["x"]), r"truth\[0\]: not a path like"),
        (with_panel(truth=["nav.counters.faults"]), r"truth\[0\]: not a path"),
        (with_panel(truth=["nav.outputs.x[a]"]), r"truth\[0\]: not a path"),
        (with_panel(truth=[7]), r"truth\[0\]: not a text"),
        (with_body(shape="cube"), "views.body.shape: not one of lander, "),
        (with_body(size=0), "views.body.size: not a number from 0.001"),
        (with_body(size=True), "size: not a number"),
        (with_body(size=10**400), "size: not a number"),
        (with_body(up="z"), r"up: not \"\+z\" or"),
        (with_body(position=["a.outputs.x"]), "position: not one path of an array of 3"),
        (with_body(position=[0, 0, None]), r"position\[2\]: not a number"),
        (with_body(mesh="a.glb"), "mesh: the file of"),
        (with_body(shape="mesh"), "mesh: the file of"),
        (with_body(shape="mesh", mesh="/etc/passwd"), r"mesh: the name of a mesh ends in .glb, .stl, .obj"),
        (json.dumps({"panels": [], "body": {"shape": "rover"}}), "neither position nor attitude"),
        ('{"panels": [], "body": {"shape": "rover", "size": NaN}}', "NaN is not a number of JSON"),
    ],
)
def test_what_is_not_a_block_is_one_sentence(text: str, reason: str) -> None:
    with pytest.raises(ViewError, match=reason) as caught:
        parse_views(text)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just("a.outputs.x"),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from([*BODY, *PANEL, "panels", "body", "x"]), inner, max_size=5)
    ),
    max_leaves=12,
)


@given(block=_JSON, member=_JSON)
def test_whatever_the_text_is_there_is_a_block_or_a_remark(block: Any, member: Any) -> None:
    for text in (json.dumps(block), json.dumps({"panels": [member]}), json.dumps({"panels": [PANEL], "body": member})):
        views, remark = views_or_remark(text)
        assert (views is None) == bool(remark)


def test_no_text_is_no_block() -> None:
    assert views_or_remark("") == (None, "")
    assert views_or_remark("{}")[1].startswith("the views of the run (views: holds neither")


def test_a_file_is_a_machine_a_simulation_or_the_block(tmp_path: Path) -> None:
    block = {"panels": [PANEL], "body": {"shape": "mesh", "mesh": "craft.stl", "attitude": "a.outputs.q"}}
    for name, content in (("machine", {"tick_hz": 100, "states": {}, "views": block}), ("alone", block)):
        (tmp_path / name).write_text(json.dumps(content))
        views = read_views(tmp_path / name)
        assert views.body is not None and views.body.mesh == str(tmp_path / "craft.stl")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b'{"tick_hz": 100}', 'no member "views"'),
        (b'{"extends": "a.sim.json"}', 'no member "views": it extends "a.sim.json"; name the file that has them'),
        (b"\xff\xfe", "not a JSON file"),
        (b"{", "the file: not valid JSON"),
        (b'{"views": null}', "not an object"),
        (b"", "not valid JSON"),
    ],
)
def test_a_file_that_is_none_of_these_is_named(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(ViewError, match=f"x.json: .*{reason}"):
        read_views(tmp_path / "x.json")
    for absent in (tmp_path / "none.json", tmp_path):
        with pytest.raises(ViewError, match=str(absent)):
            read_views(absent)
