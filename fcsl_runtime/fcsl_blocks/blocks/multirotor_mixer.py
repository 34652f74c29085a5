# SPDX-License-Identifier: Apache-2.0
"""Control allocation of a multirotor: thrust and torques to the thrusts of its rotors."""

from fcsl_builtins import all, clamp, isfinite, ldl_solve, matvec, max, min, symmetric_product, transpose, zeros


class MultirotorMixer:
    """Control allocation (mixer) of n rotors with priorities: roll and pitch before thrust before yaw.

    (torque, thrust) = A T, A's column of a rotor at (x, y): (s y, -s x, -s direction torque_per_thrust, 1)
    T = a (M0 torque_x + M1 torque_y) + f M3 + b M2 torque_z, M = A' (A A')^-1 (the pseudoinverse)

    s is 1, or -1 with z_down. Within the limits a = b = 1, f = thrust: T is the least-squares allocation. Otherwise, in
    this order: a is the greatest in 0..1 for which any f keeps all rotors within low..high; f is the nearest to `thrust`
    that does; b is the greatest in 0..1 that still does. Roll and pitch so keep their ratio, thrust is lowered and raised
    for them, and yaw takes what is left. With may_raise = false, f is never above `thrust` nor above what `low` makes
    necessary: on the ground, a vehicle without thrust then does not stir its rotors.

    The block has no memory: first run, breaks and period make no difference.

    Source: PX4 Autopilot, ControlAllocationSequentialDesaturation.cpp (sequence of thrust, roll and pitch, yaw); the signs
    of PX4's rotor geometry. Instead of its passes with gains, each step here is solved exactly: for a given a, rotor i
    asks for (low_i - a p_i) / g_i <= f <= (high_i - a p_i) / g_i, with p the roll and pitch part of T and g = M3; so a is
    bounded by each pair of rotors, and b by each rotor.
    Limits: thrusts are parallel to z. Geometries that cannot command all four axes, or that need a rotor without thrust
    or with negative thrust for pure lift (an element of M3 is not above zero), have health failed; their outputs mean
    nothing. Limits low..high that hold for no f at all are kept rotor by rotor. A run whose thrusts are not finite, as of
    an input that is no number, is passed over: outputs stay, and health is degraded.
    """

    inputs = {
        "thrust": "f64 N",  # collective, upwards
        "torque": "f64[3] N*m",  # about body x, y, z
    }
    parameters = {
        "position": "f64[n][2] m",  # x and y of each rotor, from the centre of mass, body axes
        "direction": "f64[n] in -1..1",  # spin seen from above: 1 counterclockwise, -1 clockwise
        "torque_per_thrust": "f64[n] m in 0..",  # reaction torque of a rotor, N m per N
        "low": "f64[n] N = 0",  # least thrust of each rotor
        "high": "f64[n] N",  # greatest thrust of each rotor
        "z_down": "bool = false",  # body axes forward, right, down; else forward, left, up
        "may_raise": "bool = true",  # more thrust than commanded, for the sake of roll and pitch
    }
    outputs = {
        "rotor_thrust": "f64[n] N",
        "applied_thrust": "f64 N",  # of these rotor thrusts
        "applied_torque": "f64[3] N*m",  # of these rotor thrusts
        "tilt_share": "f64",  # a, the part of the roll and pitch torques that is applied
        "yaw_share": "f64",  # b, the part of the yaw torque that is applied
        "saturated": "bool",  # not all of the command is applied
    }

    def execute(self):
        side = -1.0 if self.z_down else 1.0
        effect = zeros(4, len(self.low))
        for i in range(len(self.low)):
            effect[0, i] = side * self.position[i, 1]
            effect[1, i] = -side * self.position[i, 0]
            effect[2, i] = -side * self.direction[i] * self.torque_per_thrust[i]
            effect[3, i] = 1.0
        mix = ldl_solve(symmetric_product(effect, transpose(effect)), effect)  # rows: roll, pitch, yaw, thrust
        lift = mix[3]
        sound = all(isfinite(lift)) and all(lift > 0.0)

        # shares are of the torques divided by these, which overflow nowhere
        tilt = max(1.0, abs(self.torque[0]), abs(self.torque[1]))
        turn = max(1.0, abs(self.torque[2]))
        part = (self.torque[0] / tilt) * mix[0] + (self.torque[1] / tilt) * mix[1]
        slope = part / lift
        least = self.low / lift
        most = self.high / lift
        ceiling = 1e308 if self.may_raise else max(self.thrust, max(least))
        share = tilt
        for i in range(len(self.low)):
            if slope[i] < 0.0:
                share = min(share, max(0.0, (ceiling - least[i]) / -slope[i]))
            for k in range(len(self.low)):
                if slope[k] > slope[i]:
                    share = min(share, max(0.0, (most[k] - least[i]) / (slope[k] - slope[i])))
        collective = clamp(self.thrust, max(least - share * slope), min(most - share * slope))
        wanted = share * part + collective * lift

        yaw = (self.torque[2] / turn) * mix[2]
        rest = turn
        for i in range(len(self.low)):
            if yaw[i] > 0.0:
                rest = min(rest, max(0.0, (self.high[i] - wanted[i]) / yaw[i]))
            if yaw[i] < 0.0:
                rest = min(rest, max(0.0, (self.low[i] - wanted[i]) / yaw[i]))
        thrusts = clamp(wanted + rest * yaw, self.low, self.high)
        if not sound:
            self.health = "failed"
        elif not all(isfinite(thrusts)):
            self.health = "degraded"
            return
        self.rotor_thrust = thrusts
        applied = matvec(effect, self.rotor_thrust)
        self.applied_torque = applied[0:3]
        self.applied_thrust = applied[3]
        self.tilt_share = share / tilt
        self.yaw_share = rest / turn
        self.saturated = share < tilt or rest < turn or collective != self.thrust
