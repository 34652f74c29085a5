# SPDX-License-Identifier: Apache-2.0
"""The files of the page, in web/. They are the same for everybody: what they show, they ask for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from starlette.responses import Response

_FOLDER = Path(__file__).parent / "web"
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
#: The page executes its own files alone, sends requests to this supervisor alone, and makes no HTML from text.
_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; require-trusted-types-for 'script'; trusted-types 'none'"
)


def _read() -> Mapping[str, tuple[bytes, str]]:
    files = {path.name: (path.read_bytes(), _TYPES[path.suffix]) for path in _FOLDER.iterdir() if path.suffix in _TYPES}
    home = files.pop("index.html")
    return {"/": home, **{f"/{name}": file for name, file in files.items()}}


#: Content and type by path.
FILES = _read()


def answer(path: str) -> Response:
    content, kind = FILES[path]
    return Response(content, media_type=kind, headers={"content-security-policy": _SECURITY_POLICY})
