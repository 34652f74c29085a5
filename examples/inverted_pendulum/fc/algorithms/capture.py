"""Where balance can take over, and where it has lost.

With the state z = (s - r, a, s', a') around a reference r at rest, the linear loop does not leave the ellipsoid
z^T cost z < 1, and nowhere in it asks for more force than the motor has: `cost` is the solution P of the Riccati
equation, times k P^-1 k^T / force_limit^2. The reference is free to choose, so the state is in the ellipsoid if it is
with the best lead s - r.
"""

from __future__ import annotations

from fcsl_builtins import dot, f64, matvec


def best_lead(cost: f64[4][4], tilt: f64, speed: f64, rate: f64) -> f64:
    """s - r with the smallest value, m."""
    return f64(-(cost[0, 1] * tilt + cost[0, 2] * speed + cost[0, 3] * rate) / cost[0, 0])


def least_value(cost: f64[4][4], tilt: f64, speed: f64, rate: f64) -> f64:
    """The value there: below 1 balance can take over."""
    z = [best_lead(cost, tilt, speed, rate), tilt, speed, rate]
    return dot(z, matvec(cost, z))
