# SPDX-License-Identifier: Apache-2.0
"""Names of topics in a bag of `fcsl bus record`."""

from __future__ import annotations

import re


def topic_of(prefix: str, name: str) -> str:
    """`/[NAMESPACE/]MACHINE/NAME`; a channel has a level for each dot of its name."""
    return "/" + re.sub(r"[^\w/]", "_", f"{prefix}/{name.replace('.', '/')}", flags=re.ASCII)
