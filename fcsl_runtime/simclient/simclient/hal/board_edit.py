# SPDX-License-Identifier: Apache-2.0
"""Changes members of a board's JSON and leaves all other text as it is."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile
from fcsl_compiler.api.json_files import JsonNode, parse_json

#: Members by key: objects are merged, anything else replaces what is there.
Changes = Mapping[str, Any]
_Edit = tuple[int, int, str]


def changed_text(source: SourceFile, place: JsonNode, changes: Changes) -> str:
    """The text with these members of the object at `place`."""
    text = source.text
    for start, end, new in sorted(_edits(source, place, changes), reverse=True):
        text = text[:start] + new + text[end:]
    parsed = parse_json(SourceFile(source.name, text), DiagnosticSink())
    assert parsed is not None
    return text


def _edits(source: SourceFile, node: JsonNode, changes: Changes) -> Iterator[_Edit]:
    gap = _gap(source, node)
    added = []
    for key, value in changes.items():
        member = node.members.get(key)
        if member is None:
            added.append(f"{json.dumps(key)}: {_json_text(value, gap)}")
        elif isinstance(value, Mapping) and member.value.kind == "object":
            yield from _edits(source, member.value, value)
        else:
            yield (*source.offsets(member.value.span), _json_text(value, gap))
    if not added:
        return
    start, end = source.offsets(node.span)
    if not node.members:
        yield start, end, f"{{{', '.join(added)}}}"
        return
    last = source.offsets(list(node.members.values())[-1].value.span)[1]
    yield last, last, "".join(f",{gap}{text}" for text in added)


def _gap(source: SourceFile, node: JsonNode) -> str:
    """What stands before a member: that before the last one, a new line and its indentation or a space."""
    if not node.members:
        return " "
    key = source.offsets(list(node.members.values())[-1].key_span)[0]
    before = source.text[:key]
    gap = before[len(before.rstrip(" \t\n")) :]
    return gap[gap.rindex("\n") :] if "\n" in gap else " "


def _json_text(value: Any, gap: str) -> str:
    """A list of objects stands line by line where members do."""
    if isinstance(value, list) and value and isinstance(value[0], Mapping) and "\n" in gap:
        items = ",".join(f"{gap}  {json.dumps(item)}" for item in value)
        return f"[{items}{gap}]"
    return json.dumps(value)
