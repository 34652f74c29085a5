# SPDX-License-Identifier: Apache-2.0
"""What the odometries of wheeled vehicles share: turns of wheels, the step along an arc, covariances in a plane."""

from fcsl_builtins import abs, cos, f64, matmul, round, sin, symmetric_product, transpose, zeros


def turned(angles: "f64[2]", last: "f64[2]", angle_range: f64) -> "f64[2]":
    """Turns of two wheels since `last`. Angles begin anew after `angle_range`; 0: they never do."""
    turns = angles - last
    if angle_range > 0.0:
        turns -= angle_range * round(turns / angle_range)
    return turns


def along_arc(heading: f64, forward: f64, turn: f64) -> tuple["f64[2]", "f64[3]", "f64[3]"]:
    """The step in x and y along an arc of constant curvature, and d pose / d forward, d pose / d turn.

    step = forward sinc(turn / 2) (cos(heading + turn / 2), sin(heading + turn / 2))
    """
    half = 0.5 * turn
    square = half * half
    if abs(half) < 0.01:
        sinc = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
        slope = -half / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))  # d sinc / d half
    else:
        sinc = sin(half) / half
        slope = (cos(half) - sinc) / half
    along = [cos(heading + half), sin(heading + half)]
    across = [-along[1], along[0]]
    swing = (0.5 * forward) * (slope * along + sinc * across)
    return forward * sinc * along, [sinc * along[0], sinc * along[1], 0.0], [swing[0], swing[1], 1.0]


def carried(covariance: "f64[3][3]", step: "f64[2]") -> "f64[3][3]":
    """F P F', F = d pose / d pose: the covariance of x, y, heading after a step."""
    jacobian = [[1.0, 0.0, -step[1]], [0.0, 1.0, step[0]], [0.0, 0.0, 1.0]]
    return symmetric_product(matmul(jacobian, covariance), transpose(jacobian))


def pose_covariance(planar: "f64[3][3]", planar_variance: f64) -> "f64[6][6]":
    """That of x, y, z, roll, pitch, yaw, of that of x, y, heading; `planar_variance` of what a plane fixes."""
    made = zeros(6, 6)
    made[0:2, 0] = planar[0:2, 0]
    made[0:2, 1] = planar[0:2, 1]
    made[0:2, 5] = planar[0:2, 2]
    made[5, 0:2] = planar[2, 0:2]
    made[5, 5] = planar[2, 2]
    for i in range(2, 5):
        made[i, i] = planar_variance
    return made


def twist_covariance(speed: f64, joint: f64, yaw_rate: f64, planar_variance: f64) -> "f64[6][6]":
    """That of the velocities, of the variances of speed and yaw rate, and of what both have in common."""
    made = zeros(6, 6)
    made[0, 0] = speed
    made[0, 5] = joint
    made[5, 0] = joint
    made[5, 5] = yaw_rate
    for i in range(1, 5):
        made[i, i] = planar_variance
    return made
