"""Kalman filter of altitude z and vertical velocity v.

Prediction over one tick with the acceleration a that `engine` expects of the thrust it commanded:

    z' = z + v dt + a dt^2 / 2,    v' = v + a dt,    Q = accel_sigma^2 g g',  g = [dt^2 / 2, dt]

where `accel_sigma` stands for what that expectation misses (thrust, mass and valve errors). Each usable sample is then
taken as a scalar measurement, covariances in Joseph's form. Without samples the prediction goes on alone (dead
reckoning), which the filter reports as degraded. On the ground the velocity is known to be zero.

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001, sections 5.2
(filter) and 6.3.2 (piecewise constant white acceleration).
"""

from fcsl_builtins import (
    Health,
    kf_gain,
    kf_predict_cov,
    kf_predict_state,
    kf_update_cov_joseph,
    kf_update_state,
    sqrt,
)

H_POS = [[1.0, 0.0]]
H_VEL = [[0.0, 1.0]]


class Inputs:
    pos_z: "f64 m"  # measured
    vel_z: "f64 m/s"
    pos_valid: bool
    vel_valid: bool
    acceleration: "f64 m/s^2"  # expected since the last tick, gravity included
    landed: bool
    dt: "f64 s"


class Parameters:
    pos_sigma: "f64 m"  # standard deviations of the sensors
    vel_sigma: "f64 m/s"
    accel_sigma: "f64 m/s^2"  # of the error of `acceleration`, one draw each tick


class Outputs:
    pos_z: "f64 m"  # estimates
    vel_z: "f64 m/s"
    pos_sigma: "f64 m"  # their standard deviations, as the filter sees them
    vel_sigma: "f64 m/s"


class State:
    initialised: bool
    x: "f64[2]"  # z in m, v in m/s
    P: "f64[2,2]"  # their covariance


def execute(u: Inputs, p: Parameters, s: State, y: Outputs) -> None:
    R_pos = [[p.pos_sigma * p.pos_sigma]]
    R_vel = [[p.vel_sigma * p.vel_sigma]]
    if not s.initialised:
        s.initialised = u.pos_valid and u.vel_valid
        if s.initialised:
            s.x = [u.pos_z, u.vel_z]
            s.P = [[R_pos[0, 0], 0.0], [0.0, R_vel[0, 0]]]
    else:
        F = [[1.0, u.dt], [0.0, 1.0]]
        g = [u.dt * u.dt / 2.0, u.dt]
        q = p.accel_sigma * p.accel_sigma
        Q = [[q * g[0] * g[0], q * g[0] * g[1]], [q * g[1] * g[0], q * g[1] * g[1]]]
        s.x = kf_predict_state(F, s.x)
        if u.landed:
            s.x[1] = 0.0
        else:
            s.x = s.x + g * u.acceleration
        s.P = kf_predict_cov(F, s.P, Q)
        if u.pos_valid:
            K = kf_gain(s.P, H_POS, R_pos)
            s.x = kf_update_state(s.x, K, [u.pos_z], H_POS)
            s.P = kf_update_cov_joseph(s.P, K, H_POS, R_pos)
        if u.vel_valid:
            K = kf_gain(s.P, H_VEL, R_vel)
            s.x = kf_update_state(s.x, K, [u.vel_z], H_VEL)
            s.P = kf_update_cov_joseph(s.P, K, H_VEL, R_vel)
    if not (u.pos_valid and u.vel_valid):
        y.health = Health.degraded
    y.pos_z = s.x[0]
    y.vel_z = s.x[1]
    y.pos_sigma = sqrt(s.P[0, 0])
    y.vel_sigma = sqrt(s.P[1, 1])
