# SPDX-License-Identifier: Apache-2.0
"""Tables between whose points lines, planes or volumes are drawn. F is f64 or f32.

Breakpoints ascend; if they do not, the result is one of those that a search finds, the same in every run.
"""

from fcsl_builtins import clamp, lerp, sat_i64, wrap_add, wrap_sub


def interp_cell(x: "F", xs: "F[n]") -> "i64":
    """The i for which xᵢ ≤ x < xᵢ₊₁; 0 below all breakpoints, n − 2 above.

    Order: bisection, exact; at most ⌈log₂ n⌉ comparisons. For n > 512 it begins with the cells around that which evenly
    spaced breakpoints would have, so that these take four comparisons, whatever n is.
    Singular: x NaN: 0.
    """
    low = 0
    high = n - 1
    if n > 512:
        even = sat_i64((x - xs[0]) / (xs[n - 1] - xs[0]) * (n - 1))
        first = clamp(wrap_sub(even, 1), 0, n - 2)
        last = clamp(wrap_add(first, 3), 0, n - 1)
        if xs[first] <= x:
            low = first
        if x < xs[last]:
            high = last
    for _ in range(16):
        if wrap_sub(high, low) <= 1:
            break
        middle = clamp(wrap_add(low, high) // 2, 0, n - 1)
        if xs[middle] <= x:
            low = middle
        else:
            high = middle
    return low


def extrapolate(x: "F", xs: "F[n]", ys: "F[n]") -> "F":
    """The line through the two points beside x; beyond the ends the first and the last line go on.

    Order: i = interp_cell(x, xs), t = (x − xᵢ) / (xᵢ₊₁ − xᵢ), then lerp(yᵢ, yᵢ₊₁, t).
    Singular: x NaN or infinite: NaN or an infinity.
    """
    i = clamp(interp_cell(x, xs), 0, n - 2)
    return lerp(ys[i], ys[i + 1], (x - xs[i]) / (xs[i + 1] - xs[i]))


def interp(x: "F", xs: "F[n]", ys: "F[n]") -> "F":
    """The line through the two points beside x; beyond the ends y₀ and yₙ₋₁.

    Order: extrapolate, of x clamped to the breakpoints.
    Singular: x NaN: NaN.
    """
    return extrapolate(clamp(x, xs[0], xs[n - 1]), xs, ys)


def extrapolate2(x: "F", y: "F", xs: "F[n]", ys: "F[m]", zs: "F[n][m]") -> "F":
    """Bilinear between the four points around (x, y); beyond the ends the outermost cells go on.

    Order: as extrapolate along y, in the two rows beside x, then along x.
    Singular: x or y NaN or infinite: NaN or an infinity.
    """
    i = clamp(interp_cell(x, xs), 0, n - 2)
    j = clamp(interp_cell(y, ys), 0, m - 2)
    s = (y - ys[j]) / (ys[j + 1] - ys[j])
    t = (x - xs[i]) / (xs[i + 1] - xs[i])
    return lerp(lerp(zs[i, j], zs[i, j + 1], s), lerp(zs[i + 1, j], zs[i + 1, j + 1], s), t)


def interp2(x: "F", y: "F", xs: "F[n]", ys: "F[m]", zs: "F[n][m]") -> "F":
    """Bilinear between the four points around (x, y), each clamped to its breakpoints.

    Order: extrapolate2, of the clamped x and y.
    Singular: x or y NaN: NaN.
    """
    return extrapolate2(clamp(x, xs[0], xs[n - 1]), clamp(y, ys[0], ys[m - 1]), xs, ys, zs)


def extrapolate3(x: "F", y: "F", z: "F", xs: "F[n]", ys: "F[m]", zs: "F[k]", ws: "F[n][m][k]") -> "F":
    """Trilinear between the eight points around (x, y, z); beyond the ends the outermost cells go on.

    Order: as extrapolate along z, in the four rows around (x, y), then along y, then along x.
    Singular: x, y or z NaN or infinite: NaN or an infinity.
    """
    h = clamp(interp_cell(x, xs), 0, n - 2)
    i = clamp(interp_cell(y, ys), 0, m - 2)
    j = clamp(interp_cell(z, zs), 0, k - 2)
    r = (z - zs[j]) / (zs[j + 1] - zs[j])
    s = (y - ys[i]) / (ys[i + 1] - ys[i])
    t = (x - xs[h]) / (xs[h + 1] - xs[h])
    g = clamp(h + 1, 1, n - 1)
    near = lerp(lerp(ws[h, i, j], ws[h, i, j + 1], r), lerp(ws[h, i + 1, j], ws[h, i + 1, j + 1], r), s)
    far = lerp(lerp(ws[g, i, j], ws[g, i, j + 1], r), lerp(ws[g, i + 1, j], ws[g, i + 1, j + 1], r), s)
    return lerp(near, far, t)


def interp3(x: "F", y: "F", z: "F", xs: "F[n]", ys: "F[m]", zs: "F[k]", ws: "F[n][m][k]") -> "F":
    """Trilinear between the eight points around (x, y, z), each clamped to its breakpoints.

    Order: extrapolate3, of the clamped x, y and z.
    Singular: x, y or z NaN: NaN.
    """
    return extrapolate3(
        clamp(x, xs[0], xs[n - 1]), clamp(y, ys[0], ys[m - 1]), clamp(z, zs[0], zs[k - 1]), xs, ys, zs, ws
    )
