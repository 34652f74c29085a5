from rc import ARM, KILL, ON


class Arming:
    """Arms and disarms. It alone decides, whatever state the machine is in.

    It arms on the rising edge of the switch, if arming has been allowed for `allowed_s`. An edge that comes earlier is
    lost. The kill switch disarms at once and everywhere; the arm switch, and the loss of the remote control for longer
    than `rc_timeout_s`, on the ground alone: in the air the motor is needed.
    """

    inputs = {
        "allowed": "bool",
        "sticks": "f64[8]",
        "rc_valid": "bool",
        "distance": "f64 m",
        "range_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "armed": "bool",
        "rc_lost": "bool",
        "on_ground": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "allowed_s": "f64 s in 0.1..",
        "rc_timeout_s": "f64 s in 0..",
        "ground_distance": "f64 m in 0..",  # below it the vehicle is on the ground
    }
    state = {"switch_was": "bool", "allowed_for": "f64 s", "lost_for": "f64 s"}

    def execute(self):
        killed = not (self.sticks[KILL] < ON)
        switch = self.sticks[ARM] > ON
        rises = switch and not self.switch_was
        self.switch_was = switch
        self.allowed_for = self.allowed_for + self.dt if self.allowed else 0.0
        self.lost_for = 0.0 if self.rc_valid else self.lost_for + self.dt
        self.rc_lost = self.lost_for > self.rc_timeout_s
        self.on_ground = self.range_valid and self.distance < self.ground_distance
        if killed or (self.armed and self.on_ground and self.rc_lost):
            self.armed = False
            self.transition_request = "SAFE"
        elif not switch and (self.on_ground or not self.armed):
            self.armed = False
            self.transition_request = "STANDBY"
        elif rises and self.allowed_for >= self.allowed_s:
            self.armed = True
            self.transition_request = "MANUAL"
