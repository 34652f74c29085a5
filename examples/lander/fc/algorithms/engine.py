"""The engine as the flight computer sees it: obeys the controller that flies, and expects an effect of that.

A controller flies when the active state runs it; the others are stale, and their last throttle is history. With none of
them the engine is off. The expected effect follows from thrust and propellant:

    thrust = throttle max_thrust,    a = thrust / mass - gravity,    mass' = -thrust / (specific_impulse g0)
"""

from fcsl_builtins import Health, max

G0 = 9.80665  # standard gravity, m/s^2: part of the definition of specific impulse


class Inputs:
    ascent_health: Health
    ascent_throttle: f64
    descent_health: Health
    descent_throttle: f64
    descent_landed: bool
    safe_health: Health
    safe_throttle: f64
    safe_landed: bool
    dt: "f64 s"


class Parameters:
    max_thrust: "f64 N"
    specific_impulse: "f64 s"
    wet_mass: "f64 kg"  # at launch
    dry_mass: "f64 kg"
    gravity: "f64 m/s^2"


class Outputs:
    throttle: f64  # to the valve, 0 to 1
    acceleration: "f64 m/s^2"  # expected until the next tick, positive upward
    mass: "f64 kg"  # expected at the next tick
    landed: bool  # the vehicle stands on the ground, engine off


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.throttle = 0.0
    y.landed = False
    if u.ascent_health != Health.stale:
        y.throttle = u.ascent_throttle
    elif u.descent_health != Health.stale:
        y.throttle = u.descent_throttle
        y.landed = u.descent_landed
    elif u.safe_health != Health.stale:
        y.throttle = u.safe_throttle
        y.landed = u.safe_landed
    thrust = y.throttle * p.max_thrust
    y.acceleration = thrust / y.mass - p.gravity
    y.mass = max(y.mass - thrust / (p.specific_impulse * G0) * u.dt, p.dry_mass)


def start(p: Parameters, y: Outputs) -> None:
    y.mass = p.wet_mass
