"""The velocity asked for by whichever block runs in this state."""


class Inputs:
    mission: "f64[3]"
    mission_health: Health
    landing: "f64[3]"
    landing_health: Health
    hold: "f64[3]"
    hold_health: Health


class Outputs:
    velocity: "f64[3]"


def execute(u: Inputs, y: Outputs) -> None:
    if u.mission_health != Health.stale:
        y.velocity = u.mission
    elif u.landing_health != Health.stale:
        y.velocity = u.landing
    elif u.hold_health != Health.stale:
        y.velocity = u.hold
    else:
        y.velocity = [0.0, 0.0, 0.0]
