"""Unpowered flight over the top, until the fall reaches the velocity profile that `descent` brakes along.

From altitude h the profile allows the speed from which a constant deceleration `brake` reaches `touchdown_speed` at
`final_altitude`:  v(h)^2 = touchdown_speed^2 + 2 brake (h - final_altitude).  Turned around, it is the altitude at which
braking must begin at the present speed.
"""

from fcsl_builtins import TransitionRequest


class Inputs:
    pos_z: "f64 m"  # estimates
    vel_z: "f64 m/s"


class Parameters:
    brake: "f64 m/s^2"
    touchdown_speed: "f64 m/s"
    final_altitude: "f64 m"


class Outputs:
    ignition_altitude: "f64 m"  # where braking must begin at this speed


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    excess = u.vel_z * u.vel_z - p.touchdown_speed * p.touchdown_speed
    y.ignition_altitude = p.final_altitude + excess / (2.0 * p.brake)
    if u.vel_z < -p.touchdown_speed and u.pos_z <= y.ignition_altitude:
        y.transition_request = TransitionRequest.START_DESCENT
