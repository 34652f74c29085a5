"""Fault monitor: decides which sensor samples may be used, and fails when a sensor stays unusable.

A sample is usable when the sensor block is healthy (the host fails it when a channel's samples stop coming) and the value
is a number within the instrument's measuring range. An unusable sample is passed over at once; a sensor without a usable
sample for longer than `patience` fails the monitor, and with it the machine goes to SAFE. A step in altitude is no fault.
"""

from fcsl_builtins import Health, isfinite


class Inputs:
    pos_z: "f64 m"
    vel_z: "f64 m/s"
    sensors_health: Health
    dt: "f64 s"


class Parameters:
    min_altitude: "f64 m"  # measuring range of the altimeter
    max_altitude: "f64 m"
    max_speed: "f64 m/s"  # measuring range of the velocimeter, either direction
    patience: "f64 s"


class Outputs:
    pos_valid: bool  # this tick's altitude may be used
    vel_valid: bool  # this tick's velocity may be used


class State:
    pos_lost: "f64 s"  # time without a usable altitude
    vel_lost: "f64 s"  # time without a usable velocity


def execute(u: Inputs, p: Parameters, s: State, y: Outputs) -> None:
    alive = u.sensors_health != Health.failed
    y.pos_valid = alive and isfinite(u.pos_z) and p.min_altitude <= u.pos_z <= p.max_altitude
    y.vel_valid = alive and isfinite(u.vel_z) and -p.max_speed <= u.vel_z <= p.max_speed
    s.pos_lost = 0.0 if y.pos_valid else s.pos_lost + u.dt
    s.vel_lost = 0.0 if y.vel_valid else s.vel_lost + u.dt
    if s.pos_lost > p.patience or s.vel_lost > p.patience:
        y.health = Health.failed
    elif not (y.pos_valid and y.vel_valid):
        y.health = Health.degraded
