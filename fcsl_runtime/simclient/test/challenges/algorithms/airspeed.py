from fcsl_builtins import sqrt


class AirspeedMonitor:
    """Warns where the airspeed is too low for the fly-up of a ground collision avoidance system.

    Once a warning is allowed, it is compared anew only while the monitor is enabled, or the avoidance system warns,
    and the interlocks have not failed; else the last one stays.
    """

    inputs = {
        "weight": "f64",
        "stores": "i32",  # 0: category I, else category III
        "impact_pressure": "f64",
        "gear_up": "bool",
        "enabled": "bool",
        "avoidance_warns": "bool",
        "interlocks_failed": "bool",
    }
    outputs = {"min_airspeed": "f64", "min_pressure": "f64", "allowed": "bool", "warning": "bool"}

    def execute(self):
        gain = 1.25921 if self.stores == 0 else 1.33694
        self.min_airspeed = gain * sqrt(self.weight) + 10.0
        self.min_pressure = (0.020306 * self.min_airspeed - 2.0906 + 0.1) * 70.7184
        if not self.gear_up:
            self.allowed = False
        elif self.impact_pressure > self.min_pressure:
            self.allowed = True
        if self.allowed and not self.interlocks_failed and (self.enabled or self.avoidance_warns):
            self.warning = self.impact_pressure < self.min_pressure
