from fcsl_builtins import (
    acos,
    asin,
    atan,
    atan2,
    cbrt,
    ceil,
    copysign,
    cos,
    cosh,
    exp,
    expm1,
    floor,
    fmod,
    hypot,
    log,
    log1p,
    log2,
    log10,
    pow,
    round,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    trunc,
    wrap_angle,
)


class Elementary32:
    """Every elementary function on numbers of 32 bits."""

    inputs = {"x": "f32", "z": "f32"}
    outputs = {
        "one": "f32[22]",  # of x
        "two": "f32[9]",  # of x and z
        "nested": "f32[2]",  # of x: clang 19 by itself makes NaN of NaN here
    }

    def execute(self):
        self.one[0] = sin(self.x)
        self.one[1] = cos(self.x)
        self.one[2] = tan(self.x)
        self.one[3] = asin(self.x / 1024.0)
        self.one[4] = acos(self.x / 1024.0)
        self.one[5] = atan(self.x)
        self.one[6] = sinh(self.x / 16.0)
        self.one[7] = cosh(self.x / 16.0)
        self.one[8] = tanh(self.x)
        self.one[9] = exp(self.x / 16.0)
        self.one[10] = expm1(self.x / 16.0)
        self.one[11] = log(self.x)
        self.one[12] = log1p(self.x)
        self.one[13] = log2(self.x)
        self.one[14] = log10(self.x)
        self.one[15] = cbrt(self.x)
        self.one[16] = sqrt(self.x)
        self.one[17] = floor(self.x)
        self.one[18] = ceil(self.x)
        self.one[19] = trunc(self.x)
        self.one[20] = round(self.x)
        self.one[21] = wrap_angle(self.x)
        self.nested[0] = min(1.0, min(self.x, 1.0))
        self.nested[1] = max(0.0, max(self.x, 0.0))
        self.two[0] = atan2(self.x, self.z)
        self.two[1] = pow(self.x / 16.0, self.z / 16.0)
        self.two[2] = hypot(self.x, self.z)
        self.two[3] = fmod(self.x, self.z)
        self.two[4] = copysign(self.x, self.z)
        self.two[5] = min(self.x, self.z)
        self.two[6] = max(self.x, self.z)
        self.two[7] = self.x % self.z
        self.two[8] = self.x // self.z
