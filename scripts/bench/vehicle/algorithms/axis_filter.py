"""Alpha-beta filter of one horizontal axis of the position; `axis` chooses it."""


class Inputs:
    position: "f64[3] m"
    velocity: "f64[3] m/s"
    accuracy: "f64 m"
    accel: "f64[3]"


class Parameters:
    axis: i32
    period: "f64 s"
    alpha: f64
    beta: f64
    worst: "f64 m"  # accuracy beyond which a fix is not used


class Outputs:
    position: f64
    velocity: f64


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    a = u.accel[p.axis]
    y.position = y.position + p.period * y.velocity + 0.5 * p.period * p.period * a
    y.velocity = y.velocity + p.period * a
    if u.accuracy < p.worst:
        y.position = y.position + p.alpha * (u.position[p.axis] - y.position)
        y.velocity = y.velocity + p.beta * (u.velocity[p.axis] - y.velocity)
    else:
        y.health = Health.degraded
