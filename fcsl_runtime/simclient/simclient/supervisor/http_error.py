# SPDX-License-Identifier: Apache-2.0
"""HttpError: an error answer, with the same members as those of the variable server (docs/reference/variables.md)."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from ..vars.wire import VarError

#: HTTP status by error code of a variable server, or of its connection.
_VAR_STATUS = {
    "unknown_path": 404,
    "bad_index": 400,
    "bad_request": 400,
    "bad_value": 400,
    "timeout": 504,
    "unreachable": 503,
    "closed": 503,
    "too_many_clients": 503,
    "too_slow": 503,
    "too_large": 413,
}


class HttpError(Exception):
    """`status` is HTTP's; `code` is one of docs/guide/monitoring.md; `hint` is the probable spelling or a remedy; it may be
    empty.
    """

    def __init__(self, status: int, code: str, message: str, hint: str = ""):
        super().__init__(message)
        self.status, self.code, self.message, self.hint = status, code, message, hint

    def as_json(self) -> dict[str, dict[str, str]]:
        return {"error": {"code": self.code, "message": self.message, "hint": self.hint}}


def of_variables(error: VarError) -> HttpError:
    """Converts an error of a run's variable server."""
    return HttpError(_VAR_STATUS.get(error.code, 502), error.code, error.message, error.hint)


def nearest(word: str, choices: Iterable[str]) -> str:
    """The closest choice, or the empty string."""
    return next(iter(difflib.get_close_matches(word, list(choices), n=1, cutoff=0.5)), "")
