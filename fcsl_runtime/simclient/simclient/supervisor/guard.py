# SPDX-License-Identifier: Apache-2.0
"""Guard: access control. A web page of another origin is rejected, whatever host name it uses (DNS rebinding)."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass

from .http_error import HttpError

#: Header names are in lower case; each header occurs at most once.
Headers = Mapping[str, str]

#: Values of Sec-Fetch-Site, which browsers add: the request comes from a page of another origin.
_ELSEWHERE = ("cross-site", "same-site")


@dataclass(frozen=True)
class Guard:
    """`address` and `port` are those of the service; `token` is empty if none is required."""

    address: str
    port: int
    token: str

    def check(self, method: str, headers: Headers, is_public: bool = False) -> None:
        """Raises HttpError. `is_public`: the answer is the same for everybody, so it needs no token."""
        host = headers.get("host", "")
        if not self._own(host):
            raise HttpError(403, "bad_host", f"Host {host[:80]!r} is not this service", f"use http://{self.shown}/")
        origin = headers.get("origin")
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            raise HttpError(403, "bad_origin", f"Origin {origin[:80]!r}: pages of another origin have no access")
        if headers.get("sec-fetch-site") in _ELSEWHERE and not _follows_a_link(method, headers):
            raise HttpError(403, "bad_origin", "pages of another origin have no access")
        if self.token and not is_public:
            scheme, _, token = headers.get("authorization", "").partition(" ")
            if scheme.lower() != "bearer" or not hmac.compare_digest(token.strip().encode(), self.token.encode()):
                raise HttpError(
                    401, "unauthorized", "missing or wrong token", "Authorization: Bearer TOKEN, from --token FILE"
                )
        if method == "POST" and headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            raise HttpError(415, "bad_type", "the body must be JSON", "Content-Type: application/json")

    @property
    def shown(self) -> str:
        """Host and port as in a URL."""
        return f"[{self.address}]:{self.port}" if ":" in self.address else f"{self.address}:{self.port}"

    def _own(self, host: str) -> bool:
        """Whether a Host names this service.

        A name can be rebound, an address cannot: the only accepted name is `localhost`.
        """
        name, _, port = host.rpartition(":")
        if port != str(self.port):
            return False
        if name.lower() == "localhost":
            return True
        try:
            requested = ipaddress.ip_address(name[1:-1] if name.startswith("[") and name.endswith("]") else name)
        except ValueError:
            return False
        own = ipaddress.ip_address(self.address)
        return own.is_unspecified or requested == own


def _follows_a_link(method: str, headers: Headers) -> bool:
    """Whether the browser shows the answer as a page of its own, which the page with the link cannot read."""
    return (
        method == "GET" and headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"
    )
