# SPDX-License-Identifier: Apache-2.0
"""The seeded defect of this check: `fcsl-sim` whose engine for Ray gives the cases of a lost worker up."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from fcsl_sim.campaign import ray_engine
from fcsl_sim.campaign.flight import Flight, Outcome, not_flown
from fcsl_sim.cli import main


def give_up(self: ray_engine.Cluster, portion: list[Flight], why: str) -> Iterator[tuple[Flight, Outcome]]:
    for flight in portion:
        yield flight, not_flown(self.study, flight.case, why)


if __name__ == "__main__":
    ray_engine.Cluster._lose = give_up  # type: ignore[method-assign]
    sys.exit(main())
