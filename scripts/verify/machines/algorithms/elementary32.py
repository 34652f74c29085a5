"""Every elementary function on numbers of 32 bits."""

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
    f32,
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


class Inputs:
    x: f32
    z: f32


class Outputs:
    one: "f32[22]"  # of x
    two: "f32[9]"  # of x and z


def execute(u: Inputs, y: Outputs) -> None:
    y.one[0] = sin(u.x)
    y.one[1] = cos(u.x)
    y.one[2] = tan(u.x)
    y.one[3] = asin(u.x / 1024.0)
    y.one[4] = acos(u.x / 1024.0)
    y.one[5] = atan(u.x)
    y.one[6] = sinh(u.x / 16.0)
    y.one[7] = cosh(u.x / 16.0)
    y.one[8] = tanh(u.x)
    y.one[9] = exp(u.x / 16.0)
    y.one[10] = expm1(u.x / 16.0)
    y.one[11] = log(u.x)
    y.one[12] = log1p(u.x)
    y.one[13] = log2(u.x)
    y.one[14] = log10(u.x)
    y.one[15] = cbrt(u.x)
    y.one[16] = sqrt(u.x)
    y.one[17] = floor(u.x)
    y.one[18] = ceil(u.x)
    y.one[19] = trunc(u.x)
    y.one[20] = round(u.x)
    y.one[21] = wrap_angle(u.x)
    y.two[0] = atan2(u.x, u.z)
    y.two[1] = pow(u.x / 16.0, u.z / 16.0)
    y.two[2] = hypot(u.x, u.z)
    y.two[3] = fmod(u.x, u.z)
    y.two[4] = copysign(u.x, u.z)
    y.two[5] = min(u.x, u.z)
    y.two[6] = max(u.x, u.z)
    y.two[7] = u.x % u.z
    y.two[8] = u.x // u.z
