# SPDX-License-Identifier: Apache-2.0
"""`"extends"` in a `*.sim.json`: the file's members over those of its base, as a JSON Merge Patch (RFC 7396).

Objects are merged member by member; an array or a scalar replaces what the base has; null removes it. Every node keeps
the span of the file in which it stands, so that diagnostics point there and paths are relative to its folder.
"""

from __future__ import annotations

from pathlib import Path

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile, Span
from fcsl_compiler.api.files import SourceError
from fcsl_compiler.api.json_files import ConfigReader, JsonNode, Member, SourcePathError, parse_json, resolve_source

_KEY = "extends"


def file_of(span: Span) -> Path:
    """The file in which a node stands; paths that it names are relative to that file's folder."""
    return Path(span.source.path)


def read_extended(source: SourceFile, sink: DiagnosticSink) -> JsonNode | None:
    """The members of a simulation, merged over those of its bases. None after a syntax error, in whichever file.

    Reports E807 for a base that cannot be used, or that is among the files which extend it.
    """
    roots: list[JsonNode] = []
    chain: list[Path] = []
    while (root := parse_json(source, sink)) is not None:
        if roots and root.kind != "object":
            ConfigReader(sink).wrong(root, "a simulation is an object", "{…}")
        roots.append(root)
        chain.append(file_of(root.span))
        name = root.get(_KEY)
        base = _base(name, chain, sink) if name else None
        if base is None:
            break
        source = base
    else:
        return None
    merged = roots.pop()
    for root in reversed(roots):
        merged = _merged(merged, root)
    return merged


def _base(node: JsonNode, chain: list[Path], sink: DiagnosticSink) -> SourceFile | None:
    """The file that `extends` names; None after an error."""
    text = ConfigReader(sink).string(node, f"`{_KEY}`", "base.sim.json")
    if text is None:
        return None
    try:
        path = resolve_source(text, config=chain[-1]) if text.startswith("package://") else chain[-1].parent / text
        if "\0" in text:
            raise SourcePathError("it contains a null byte")
        earlier = next((i for i, file in enumerate(chain) if _same(file, path)), None)
        if earlier is None:
            return SourceFile.read(path, str(path))
        names = " -> ".join(file.name for file in [*chain[earlier:], chain[earlier]])
        sink.error("E807", f"a simulation extends itself: {names}", node.span, help=f"remove one `{_KEY}`")
    except (SourcePathError, SourceError) as error:
        place = [(error.span, "here")] if isinstance(error, SourceError) and error.span else []
        sink.error("E807", f"`{text}` cannot be extended: {error}", node.span, notes=place)
    return None


def _same(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:  # there is no such file; reading it reports that
        return False


def _nothing(like: JsonNode) -> JsonNode:
    return JsonNode("object", like.span, {})


def _merged(base: JsonNode, over: JsonNode) -> JsonNode:
    """`over` merged over `base`; members in the order of the base, then new ones. A null removes, also where there is
    nothing to remove (RFC 7396)."""
    if over.kind != "object":
        return over
    members = dict(base.members) if base.kind == "object" else {}
    for key, member in over.members.items():
        below = members.get(key)
        if member.value.kind == "null":
            members.pop(key, None)
        else:
            below_value = below.value if below else _nothing(member.value)
            members[key] = Member(key, member.key_span, _merged(below_value, member.value))
    return JsonNode("object", over.span, members)
