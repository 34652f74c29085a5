class Coast:
    """Unpowered flight over the top, until the fall reaches the velocity profile that `descent` brakes along.

    From altitude h the profile allows the speed from which a constant deceleration `brake` reaches
    `touchdown_speed` at `final_altitude`: v(h)^2 = touchdown_speed^2 + 2 brake (h - final_altitude). Turned around,
    it is the altitude at which braking must begin at the present speed.
    """

    inputs = {
        "pos_z": "f64 m",  # estimates
        "vel_z": "f64 m/s",
    }
    outputs = {
        "ignition_altitude": "f64 m",  # where braking must begin at this speed
        "transition_request": "TransitionRequest",
    }
    parameters = {"brake": "f64 m/s^2", "touchdown_speed": "f64 m/s", "final_altitude": "f64 m"}

    def execute(self):
        excess = self.vel_z * self.vel_z - self.touchdown_speed * self.touchdown_speed
        self.ignition_altitude = self.final_altitude + excess / (2.0 * self.brake)
        if self.vel_z < -self.touchdown_speed and self.pos_z <= self.ignition_altitude:
            self.transition_request = "START_DESCENT"
