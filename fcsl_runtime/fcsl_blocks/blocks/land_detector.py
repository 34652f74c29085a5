# SPDX-License-Identifier: Apache-2.0
"""Whether a multirotor stands on the ground."""

from fcsl_builtins import abs, all, hypot, isfinite, norm
from logic import debounced


class LandDetector:
    """Land detection of a multirotor in three stages (ground contact, maybe landed, landed), and detection of free fall.

    low(share) = thrust <= min_thrust + share (hover_thrust - min_thrust)
    still = |velocity[2]| <= max_vertical_speed w and |velocity[0:2]| <= max_horizontal_speed, or velocity_valid is false
    near = height <= max_height, or height_valid is false
    steady = |rates[0:2]| <= max_rate w
    w = widening if maybe_landed in the run before, else 1

    Each stage becomes true once its condition has held for its time without interruption, and false in the run in which
    the condition fails:
        ground_contact  low(contact_share), still, near, and descending unless maybe_landed already    for contact_time
        maybe_landed    ground_contact, low(landed_share), steady, not freefall                        for maybe_time
        landed          maybe_landed                                                                   for landed_time
        freefall        |specific_force| < freefall_limit                                              for freefall_time
    The stages lead the controller: at ground_contact it stops pushing sideways, at maybe_landed it takes the thrust away,
    which the next stage then confirms; at landed the motors may stop. Without a velocity, ground_contact wants
    low(landed_share) for blind_time. Not armed, ground_contact wants only its time, and each other stage the one before.

    In the first run after a break (`resumed`) the three stages are `initial`, freefall is false, and the times begin. The
    times count from the first run with the condition; a changed period counts from the next run on, changed parameters at
    once, times for what has passed, too.

    Source: PX4-Autopilot, src/modules/land_detector/MulticopterLandDetector.cpp (stages, conditions, widening, shares,
    defaults) and docs/en/advanced_config/land_detector.md. There, without a velocity maybe_landed alone comes, after 8 s of
    low thrust, and the shares are 0.6 and 0.1 where hover_thrust is estimated in flight.
    Limits: the least speed of a landing must exceed max_vertical_speed. A hover_thrust that is too high makes contact in
    the air possible, one at or below min_thrust makes landing undetectable. A platform that moves is no ground. Times are
    rounded as in Debounce. If an input is not finite (velocity and height: only where they are valid), the run is passed
    over: outputs and times stay, health is degraded, and a start waits.
    """

    inputs = {
        "armed": "bool",  # the motors may turn
        "descending": "bool",  # a descent is commanded; true also where the vertical speed is not controlled
        "thrust": "f64",  # commanded, all motors together, in any unit (N, or 0 to 1)
        "hover_thrust": "f64",  # thrust of hovering, in the same unit
        "velocity": "f64[3] m/s",  # in the world: two horizontal axes, the vertical one last, up or down
        "velocity_valid": "bool",  # velocity is known
        "rates": "f64[3] rad/s",  # body rates: roll, pitch, yaw, of which yaw is not used
        "specific_force": "f64[3] m/s^2",  # of the accelerometer: 9.81 at rest
        "height": "f64 m",  # above the ground
        "height_valid": "bool",  # height is known
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "min_thrust": "f64 = 0",  # least thrust that is commanded in flight, in the unit of thrust
        "contact_share": "f64 in 0..1 = 0.3",  # of the way from min_thrust to hover_thrust, for ground_contact
        "landed_share": "f64 in 0..1 = 0.1",  # the same for maybe_landed
        "max_vertical_speed": "f64 m/s in 0.. = 0.25",
        "max_horizontal_speed": "f64 m/s in 0.. = 1.5",
        "max_rate": "f64 rad/s in 0.. = 0.35",
        "widening": "f64 in 1.. = 2.5",  # of vertical speed and rates once maybe_landed, as motors spin up and down
        "max_height": "f64 m in 0.. = 1",
        "contact_time": "f64 s in 0.. = 0.33",
        "maybe_time": "f64 s in 0.. = 0.33",
        "landed_time": "f64 s in 0.. = 0.33",
        "blind_time": "f64 s in 0.. = 8",  # for ground_contact without a velocity
        "freefall_limit": "f64 m/s^2 in 0.. = 2",
        "freefall_time": "f64 s in 0.. = 0.3",
        "initial": "bool = false",  # whether it stands on the ground after a break
    }
    outputs = {
        "ground_contact": "bool",  # first stage
        "maybe_landed": "bool",  # second stage
        "landed": "bool",  # third stage
        "freefall": "bool",
    }
    state = {
        "contact_held": "f64 s",  # for how long the condition will have differed from the stage at the next run
        "maybe_held": "f64 s",
        "landed_held": "f64 s",
        "freefall_held": "f64 s",
        "begins": "bool",  # no run with finite inputs since the last break
    }

    def execute(self):
        self.begins = self.begins or self.resumed
        known = isfinite(self.thrust) and isfinite(self.hover_thrust)
        known = known and all(isfinite(self.rates)) and all(isfinite(self.specific_force))
        known = known and (all(isfinite(self.velocity)) or not self.velocity_valid)
        if not known or not (isfinite(self.height) or not self.height_valid):
            self.health = "degraded"
            return
        if self.begins:
            self.begins = False
            self.ground_contact = self.initial
            self.maybe_landed = self.initial
            self.landed = self.initial
            self.freefall = False
            self.contact_held = 0.0
            self.maybe_held = 0.0
            self.landed_held = 0.0
            self.freefall_held = 0.0

        falls = norm(self.specific_force) < self.freefall_limit
        self.freefall, self.freefall_held = debounced(
            falls, self.freefall, self.freefall_held, self.freefall_time, 0.0, self.period
        )

        wide = self.widening if self.maybe_landed else 1.0
        slow = abs(self.velocity[2]) <= self.max_vertical_speed * wide
        slow = slow and hypot(self.velocity[0], self.velocity[1]) <= self.max_horizontal_speed
        still = slow or not self.velocity_valid
        near = self.height <= self.max_height or not self.height_valid
        steady = hypot(self.rates[0], self.rates[1]) <= self.max_rate * wide
        span = self.hover_thrust - self.min_thrust
        minimal = self.thrust <= self.min_thrust + self.landed_share * span
        low = self.thrust <= self.min_thrust + self.contact_share * span if self.velocity_valid else minimal

        contact = low and still and near and (self.descending or self.maybe_landed)
        time = self.contact_time if self.velocity_valid or not self.armed else self.blind_time
        self.ground_contact, self.contact_held = debounced(
            contact or not self.armed, self.ground_contact, self.contact_held, time, 0.0, self.period
        )
        maybe = self.ground_contact and (minimal and steady and not self.freefall or not self.armed)
        self.maybe_landed, self.maybe_held = debounced(
            maybe, self.maybe_landed, self.maybe_held, self.maybe_time, 0.0, self.period
        )
        self.landed, self.landed_held = debounced(
            self.maybe_landed, self.landed, self.landed_held, self.landed_time, 0.0, self.period
        )
