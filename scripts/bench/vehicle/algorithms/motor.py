"""One motor: a limited slew, and off when the command is."""

from fcsl_builtins import clamp


class Inputs:
    motors: "f64[4]"


class Parameters:
    number: i32
    slew: f64  # greatest change in a tick


class Outputs:
    command: f64


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    wanted = u.motors[p.number]
    y.command = y.command + clamp(wanted - y.command, -p.slew, p.slew)
