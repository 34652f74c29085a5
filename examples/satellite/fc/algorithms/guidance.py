from fcsl_builtins import clamp, cos, f64, max, min, norm, quat_conj, quat_mul, quat_rotate, sin, zeros
from rotations import rotation_vector, turned


class Guidance:
    """What POINT follows: a smooth way from the present attitude to the commanded one.

    The command is an attitude at rest, or nadir: body z to the Earth, x along the track of a circular orbit with the
    elements given here, whose node drifts,

        u = u0 + n t,  node = node0 + node_rate t,   command = Rz(node) Rx(inclination) Rz(u) LVLH

    The reference begins at the estimate of attitude and rate when POINT begins, so nothing jumps. Its rate goes to

        w = w_command + e min(approach, max_rate / |e|)        e: rotation vector from reference to command

    by at most `max_acceleration`, which is available `ramp_s` after the beginning and grows until then.
    """

    inputs = {
        "attitude": "f64[4]",
        "rate": "f64[3] rad/s",
        "time_ns": "i64 ns",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "command": "f64[4]",  # body to inertial
        "reference": "f64[4]",
        "reference_rate": "f64[3] rad/s",  # in axes of the reference
        "reference_acceleration": "f64[3] rad/s^2",
        "settled": "bool",  # the reference has arrived
    }
    parameters = {
        "nadir": "bool",
        "inertial_attitude": "f64[4]",
        "inclination": "f64 rad",
        "node": "f64 rad",
        "latitude_argument": "f64 rad",  # of time 0
        "mean_motion": "f64 rad/s",
        "node_rate": "f64 rad/s",
        "approach": "f64 rad/s in 0..",  # of the last part of the way, 1/s
        "max_rate": "f64 rad/s in 0..",
        "max_acceleration": "f64 rad/s^2 in 0..",
        "ramp_s": "f64 s in 0.05..",
    }
    state = {"age": "f64 s"}

    def execute(self):
        command_rate = zeros(3)
        self.command = self.inertial_attitude
        if self.nadir:
            t = f64(self.time_ns) * 1e-9
            node = 0.5 * (self.node + self.node_rate * t)
            u = 0.5 * (self.latitude_argument + self.mean_motion * t)
            tilt = 0.5 * self.inclination
            plane = quat_mul([cos(node), 0.0, 0.0, sin(node)], [cos(tilt), sin(tilt), 0.0, 0.0])
            radial = quat_mul(plane, [cos(u), 0.0, 0.0, sin(u)])  # x up, y along the track, z along the normal
            self.command = quat_mul(radial, [0.5, -0.5, -0.5, 0.5])
            spin = quat_rotate(quat_conj(self.command), [0.0, 0.0, self.node_rate])
            command_rate = [spin[0], spin[1] - self.mean_motion, spin[2]]
        if self.resumed:
            self.reference = self.attitude
            self.reference_rate = self.rate
            self.age = 0.0
        self.age = min(self.age + self.dt, self.ramp_s)
        between = quat_mul(quat_conj(self.reference), self.command)
        e = rotation_vector(between)
        size = norm(e)
        wanted = quat_rotate(between, command_rate) + e * min(self.approach, self.max_rate / max(size, 1e-9))
        step = self.max_acceleration * self.age / self.ramp_s * self.dt
        change = wanted - self.reference_rate
        for i in range(3):
            change[i] = clamp(change[i], -step, step)
        self.reference = turned(self.reference, (self.reference_rate + change * 0.5) * self.dt)
        self.reference_rate = self.reference_rate + change
        self.reference_acceleration = change / self.dt
        self.settled = size < 1e-3
