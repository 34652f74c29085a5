# SPDX-License-Identifier: Apache-2.0
"""Guard: who may ask at all. A web page elsewhere must not, whatever name it gives this computer (DNS rebinding)."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass

from .http_error import HttpError

#: Names of headers are in small letters, each given once or not at all.
Headers = Mapping[str, str]


@dataclass(frozen=True)
class Guard:
    """`address` and `port` are where the service listens; `token` is empty where none is demanded."""

    address: str
    port: int
    token: str

    def check(self, method: str, headers: Headers) -> None:
        """Raises HttpError."""
        host = headers.get("host", "")
        if not self._own(host):
            raise HttpError(403, "bad_host", f"Host {host[:80]!r} is not this service", f"ask http://{self.shown}/")
        origin = headers.get("origin")
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            raise HttpError(
                403, "bad_origin", f"Origin {origin[:80]!r}: a page of another service may not ask this one"
            )
        if self.token:
            scheme, _, token = headers.get("authorization", "").partition(" ")
            if scheme.lower() != "bearer" or not hmac.compare_digest(token.strip().encode(), self.token.encode()):
                raise HttpError(
                    401, "unauthorized", "no token, or another", "Authorization: Bearer TOKEN, from --token FILE"
                )
        if method == "POST" and headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            raise HttpError(415, "bad_type", "the body must be JSON", "Content-Type: application/json")

    @property
    def shown(self) -> str:
        """As in an URL."""
        return f"[{self.address}]:{self.port}" if ":" in self.address else f"{self.address}:{self.port}"

    def _own(self, host: str) -> bool:
        """Whether a Host is of this service. An address cannot be rebound, a name can: of names only `localhost` is taken."""
        name, _, port = host.rpartition(":")
        if port != str(self.port):
            return False
        if name.lower() == "localhost":
            return True
        try:
            asked = ipaddress.ip_address(name[1:-1] if name.startswith("[") and name.endswith("]") else name)
        except ValueError:
            return False
        own = ipaddress.ip_address(self.address)
        return own.is_unspecified or asked == own
