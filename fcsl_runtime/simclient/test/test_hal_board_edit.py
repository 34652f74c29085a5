# SPDX-License-Identifier: Apache-2.0
"""Edits of a board's JSON: the members that are asked for change, and no other byte."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fcsl_compiler.base.diagnostics import DiagnosticSink
from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.parse.json_source import parse_json
from simclient.hal.board_edit import changed_text


def changed(text: str, changes: dict[str, Any]) -> str:
    source = SourceFile("board.json", text)
    node = parse_json(source, DiagnosticSink())
    assert node is not None
    return changed_text(source, node, changes)


@pytest.mark.parametrize(
    ("before", "changes", "after"),
    [
        ('{"a": 1,  "b":2}', {"a": [1.5, 2]}, '{"a": [1.5, 2],  "b":2}'),
        ('{"a": 1}', {"b": {"c": 2}}, '{"a": 1, "b": {"c": 2}}'),
        ("{ }", {"b": {"c": 2}}, '{"b": {"c": 2}}'),
        ('{\n    "a" : 1\n}\n', {"b": 2, "c": 3}, '{\n    "a" : 1,\n    "b": 2,\n    "c": 3\n}\n'),
        ('{"a": {"x": 1, "y": 2}}', {"a": {"y": 3, "z": 4}}, '{"a": {"x": 1, "y": 3, "z": 4}}'),
        ('{"a": {\n\t"x": 1}}', {"a": {"y": 3}}, '{"a": {\n\t"x": 1,\n\t"y": 3}}'),
        ('{"a": 1}', {"a": [{"x": 1}, {}]}, '{"a": [{"x": 1}, {}]}'),
        ('{\n  "a": 1\n}', {"s": [{"x": 1}, {}]}, '{\n  "a": 1,\n  "s": [\n    {"x": 1},\n    {}\n  ]\n}'),
        ('{"ä": "→", "a": 0}', {"a": 1}, '{"ä": "→", "a": 1}'),
    ],
)
def test_edits(before: str, changes: dict[str, Any], after: str) -> None:
    assert changed(before, changes) == after


KEYS = st.text(st.characters(codec="ascii", categories=("L",)), min_size=1, max_size=2)
LEAVES = st.integers() | st.lists(st.floats(-1e6, 1e6), max_size=3)
OBJECTS = st.recursive(
    st.dictionaries(KEYS, LEAVES, max_size=4),
    lambda inner: st.dictionaries(KEYS, LEAVES | inner, max_size=4),
    max_leaves=12,
)


def merged(value: Any, changes: Any) -> Any:
    if not isinstance(value, dict) or not isinstance(changes, dict):
        return changes
    return {**value, **{key: merged(value.get(key), change) for key, change in changes.items()}}


@given(OBJECTS, OBJECTS, st.sampled_from([None, 2, "\t"]))
def test_any_edit_is_a_merge(value: dict[str, Any], changes: dict[str, Any], indent: int | str | None) -> None:
    text = json.dumps(value, indent=indent)
    after = changed(text, changes)
    assert json.loads(after) == merged(value, changes)
    assert list(json.loads(after))[: len(value)] == list(value)
    assert changed(after, changes) == after
