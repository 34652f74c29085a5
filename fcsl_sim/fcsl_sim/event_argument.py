# SPDX-License-Identifier: Apache-2.0
"""`--event "14.0 altimeter.parameters.dropout=true"`: one more event, in the form of those of the file."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile
from fcsl_compiler.api.json_files import JsonNode, Member, parse_json

_OPTION = "--event"
_EVENT = re.compile(r"\s*(?P<at>-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)\s+(?P<path>[^\s=]+)\s*=")
_EVENTS = "events"


def with_events(root: JsonNode, events: Sequence[str], sink: DiagnosticSink) -> JsonNode:
    """The simulation with these events behind its own; each is a text of its own in messages. E215: not of the form."""
    added = [node for text in events if (node := _parse(text, sink))]
    own = root.get(_EVENTS)
    if not added or root.kind != "object" or (own and own.kind != "array"):
        return root  # the reader reports a wrong kind
    items = JsonNode("array", own.span if own else root.span, [*(own.items if own else ()), *added])
    return JsonNode("object", root.span, root.members | {_EVENTS: Member(_EVENTS, items.span, items)})


def _parse(text: str, sink: DiagnosticSink) -> JsonNode | None:
    """An event as the file would have it; None after an error."""
    source = SourceFile(_OPTION, text)
    match = _EVENT.match(text)
    if match is None:
        fix = f'{_OPTION} "14.0 altimeter.parameters.dropout=true"'
        whole = source.span(0, max(1, len(text)))
        sink.error("E215", f"`{text}` is not of the form `SECONDS instance.parameters.name=value`", whole, help=fix)
        return None
    value = parse_json(source, sink, match.end())
    if value is None:
        return None
    at_span, path_span = source.span(*match.span("at")), source.span(*match.span("path"))
    at_s = JsonNode("float", at_span, float(match["at"]), match["at"])
    path = JsonNode("string", path_span, match["path"])
    parts = {"at_s": (at_span, at_s), "set": (path_span, path), "value": (value.span, value)}
    members = {key: Member(key, span, node) for key, (span, node) in parts.items()}
    return JsonNode("object", source.span(0, len(text)), members)
