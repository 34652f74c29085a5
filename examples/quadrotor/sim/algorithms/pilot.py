from fcsl_builtins import f64


class Pilot:
    """Orders by the clock: 0 stand, 1 hold, 2 fly the mission, 3 land.

    The latest of the times that are over counts. A negative time never comes.
    """

    inputs = {"time_ns": "i64 ns"}
    outputs = {"order": "i32"}
    parameters = {"hold_s": "f64 s", "mission_s": "f64 s", "land_s": "f64 s"}

    def execute(self):
        now = f64(self.time_ns) * 1e-9
        latest = -1.0
        self.order = 0
        if 0.0 <= self.hold_s <= now and self.hold_s > latest:
            latest = self.hold_s
            self.order = 1
        if 0.0 <= self.mission_s <= now and self.mission_s > latest:
            latest = self.mission_s
            self.order = 2
        if 0.0 <= self.land_s <= now and self.land_s > latest:
            self.order = 3
