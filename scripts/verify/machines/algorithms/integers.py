"""Integers of every width, and between integers and floats: what processors without such instructions compute by hand."""

from fcsl_builtins import f32, f64, i32, i64, sat_i32, sat_i64, sat_u32, sat_u64, u32, u64, wrap_add, wrap_i32, wrap_u32


class Inputs:
    a: i64
    b: i64
    c: i32
    d: i32
    e: u64
    f: u64
    g: u32
    x: f64
    s: f32
    shift: i32


class Outputs:
    floats: "f64[6]"
    narrow: "f32[4]"
    wide: "i64[4]"
    words: "i32[4]"
    natural: "u64[6]"
    half: "u32[4]"
    ran: i64


def execute(u: Inputs, y: Outputs) -> None:
    y.floats = [f64(u.a), f64(u.e), f64(u.c), f64(u.g), f64(u.s), f64(f32(u.x))]
    y.narrow = [f32(u.a), f32(u.e), f32(u.c), f32(u.g)]
    y.wide = [sat_i64(u.x), sat_i64(u.s), wrap_add(u.a, u.b), u.a >> 7]
    y.words = [sat_i32(u.x), sat_i32(u.s), wrap_i32(u.a), u.c >> 3]
    y.natural = [sat_u64(u.x), sat_u64(u.s), u.e * u.f, (u.e << 5) | (u.f >> 3), u.e ^ u.f, ~u.e]
    y.half = [sat_u32(u.x), sat_u32(u.s), wrap_u32(u.a), u.g * 2654435761]
    y.ran = wrap_add(y.ran, 1)
    y.natural[5] = (u.e // u.f) ^ (u.e % u.f) ^ (u.e >> u.shift)  # a fault leaves all of the above as it was
    y.wide[3] = u.a // u.b + u.a % u.b
    y.words[3] = u.c // u.d - u.c % u.d
    y.wide[2] = i64(u.x) + i64(u.s)
    y.words[2] = i32(u.x)
    y.half[3] = u32(u.x)
    y.natural[4] = u64(u.s)
