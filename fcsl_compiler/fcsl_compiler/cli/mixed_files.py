# SPDX-License-Identifier: Apache-2.0
"""A line of `fcsl` that names files of several packages, as `fcsl check rover.json rover.sim.json` does: each verb gets its
files, and the options that it knows."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from collections.abc import Sequence
from typing import Any

from ..base.verb import Verb

#: Options that ask for one document on standard output.
_FORMS = ("--json", "--sarif")


def parts_of(offered: Sequence[Verb], words: Sequence[str]) -> list[tuple[Verb, list[str]]]:
    """The verbs that have a file among the words, the one that takes the rest first, each with its words."""
    rest = next(verb for verb in offered if verb.takes is None)
    known = [(verb, verb.parser()._option_string_actions) for verb in offered if verb.parser is not None]
    verbs = [rest, *(verb for verb in offered if verb is not rest)]
    options: list[list[str]] = [[] for _ in verbs]
    files: list[list[str]] = [[] for _ in verbs]
    left = list(words)
    while left:
        word = left.pop(0)
        if not word.startswith("-"):
            owner = next((verb for verb in offered if verb.takes is not None and verb.takes([word])), rest)
            files[verbs.index(owner)].append(word)
            continue
        option, equals, _ = word.partition("=")
        takers = [(verb, actions[option]) for verb, actions in known if option in actions]
        has_value = bool(takers) and takers[0][1].nargs != 0 and not equals
        taken = [word, *(left[:1] if has_value else [])]
        del left[: len(taken) - 1]
        for verb in [verb for verb, _ in takers] or [rest]:
            options[verbs.index(verb)].extend(taken)
    # Options first: argparse takes files on both sides of one for two lists.
    return [(verb, [*options[i], *files[i]]) for i, verb in enumerate(verbs) if files[i]]


def run_parts(parts: Sequence[tuple[Verb, list[str]]]) -> int:
    """The worst exit status. Several documents of `--json` become one: the first, with the lists of the others."""
    for form in _FORMS:
        if len({form in words for _, words in parts}) > 1:
            print(f"fcsl: error: not all of these files can be shown with {form}", file=sys.stderr)
            return 2
    if "--json" not in parts[0][1]:
        return max([verb.run(words) for verb, words in parts])
    statuses, documents = [], []
    for verb, words in parts:
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            statuses.append(verb.run(words))
        documents.append(json.loads(printed.getvalue() or '{"ok": false}'))  # nothing: it was interrupted
    merged: dict[str, Any] = documents[0]
    for document in documents[1:]:
        merged |= {key: value for key, value in document.items() if isinstance(value, list)}
    json.dump({**merged, "ok": all(document["ok"] for document in documents)}, sys.stdout, indent=2)
    print()
    return max(statuses)
