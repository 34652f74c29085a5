# SPDX-License-Identifier: Apache-2.0
"""The heading by a magnetometer."""

from fcsl_builtins import all, atan2, cross3, hypot, isfinite, matvec, norm, pi, quat_to_dcm, wrap_angle

LEAST_LEVEL = 0.01  # squared cosine of the pitch: the x axis is 84 degrees up or down, and has no heading


class Compass:
    """The heading of the body by the magnetic field and the vertical.

    B = (I + soft_iron) (field - hard_iron), E = d x B, N = E x d, heading = atan2(E_0, N_0) + declination

    d points down, in body axes: by the estimated attitude, of which only roll and pitch count, or until `attitude_valid`
    against the specific force, as at rest. E points to magnetic east, N to magnetic north, level both. With z_down the heading
    is measured from north to the east, without from east to the north. Give `heading` and `fresh` to a filter as its measured
    heading; connect `attitude` and `attitude_valid` from it with "delayed": true.

    Source: derived; the same as turning the field level by roll and pitch ("tilt compensation"; Razor AHRS, Compass_Heading).
    Hard and soft iron as in PX4's calibration: an offset and a matrix.
    Limits: an error of the tilt turns the heading by as much as the field dips: tan(dip) times the tilt across it, 2.3 times
    at 67 degrees. So do the filter's own errors, and the turn within the run that the attitude is old: tan(dip) times rate
    times period. A filter that takes the heading for independent of its tilt becomes overconfident in yaw; let its sigma be
    hypot(noise, tan(dip) (tilt sigma + turn in a period)) at least. A sample is passed over (fresh is false, heading stays,
    health is degraded) if it is not finite, if the field is vertical, the body's x axis within 6 degrees of it, or if
    `strength` is given and B differs from it by more than `strength_tolerance`, relative: iron or a motor is near. Iron that
    turns the field and keeps its strength is not found.
    """

    inputs = {
        "field": "f64[3]",  # magnetic flux density, body axes, in the unit of strength and hard_iron
        "field_fresh": "bool",  # field is a new sample
        "attitude": "f64[4]",  # quaternion w, x, y, z, body to world
        "attitude_valid": "bool",  # attitude is an estimate
        "specific_force": "f64[3]",  # body axes, in any unit: for the tilt until then
    }
    parameters = {
        "z_down": "bool = true",  # world NED and body FRD; else ENU and FLU
        "declination": "f64 rad = 0",  # of magnetic north, to the east
        "hard_iron": "f64[3] = 0",  # the vehicle's own field
        "soft_iron": "f64[3][3] = 0",  # what is added to the identity
        "strength": "f64 in 0.. = 0",  # of the Earth's field at the place; 0: any
        "strength_tolerance": "f64 in 0.. = 0.3",  # relative
    }
    outputs = {
        "heading": "f64 rad",  # from north to the east with z_down, else from east to the north; in [-pi, pi]
        "fresh": "bool",  # heading is new
    }

    def execute(self):
        self.fresh = False
        if not self.field_fresh:
            return
        up = -1.0 if self.z_down else 1.0
        down = -up * quat_to_dcm(self.attitude)[2]
        if not self.attitude_valid:
            down = -self.specific_force / norm(self.specific_force)
        field = self.field - self.hard_iron
        field = field + matvec(self.soft_iron, field)
        east = cross3(down, field)
        north = cross3(east, down)
        weak = self.strength > 0.0 and not abs(norm(field) / self.strength - 1.0) <= self.strength_tolerance
        steep = not 1.0 - down[0] * down[0] > LEAST_LEVEL
        if weak or steep or not (all(isfinite(north)) and hypot(east[0], north[0]) > 0.0):
            self.health = "degraded"
            return
        heading = atan2(east[0], north[0]) + self.declination
        self.heading = wrap_angle(heading if self.z_down else 0.5 * pi - heading)
        self.fresh = True
