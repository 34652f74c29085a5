"""From thrust and torques to the four motors of a quadrotor in X; torque yields to thrust."""

from fcsl_builtins import clamp


class Inputs:
    thrust: f64
    roll: f64
    pitch: f64
    yaw: f64


class Parameters:
    share: "f64[4, 3]"  # of each torque in each motor


class Outputs:
    motors: "f64[4]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    for i in range(4):
        y.motors[i] = clamp(
            u.thrust + p.share[i, 0] * u.roll + p.share[i, 1] * u.pitch + p.share[i, 2] * u.yaw, 0.0, 1.0
        )
