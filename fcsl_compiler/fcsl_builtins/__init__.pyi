# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, for editors and type checkers."""

# Made by test/test_builtins_module.py from the compiler's own tables. Do not edit.
from builtins import bool as bool
from collections.abc import Callable
from typing import Any, Literal, TypeAlias, TypeVar, overload

_Number = TypeVar("_Number", int, float)
_Value = TypeVar("_Value", bool, int, float)
_Array: TypeAlias = Any
i32: TypeAlias = int
i64: TypeAlias = int
u32: TypeAlias = int
u64: TypeAlias = int
f32: TypeAlias = float
f64: TypeAlias = float
pi: float
inf: float
nan: float
TransitionRequest: TypeAlias = str
Health: TypeAlias = Literal["nominal", "degraded", "failed", "stale"]

_Function = TypeVar("_Function", bound=Callable[..., Any])

def extern(*, header: str, lang: Literal["c"] = "c") -> Callable[[_Function], _Function]:
    """Declares a C function: @extern(header="cpu_temp.h") above a function whose body is `...`."""

def zeros(*sizes: int) -> _Array:
    """an f64 array of zeros; sizes are constants."""

def eye(n: int) -> _Array:
    """the n×n identity, f64."""

def sqrt(x: float) -> float:
    """square root."""

def sin(x: float) -> float:
    """sine of x rad."""

def cos(x: float) -> float:
    """cosine of x rad."""

def tan(x: float) -> float:
    """tangent of x rad."""

def asin(x: float) -> float:
    """arc sine, rad, in [-pi/2, pi/2]."""

def acos(x: float) -> float:
    """arc cosine, rad, in [0, pi]."""

def atan(x: float) -> float:
    """arc tangent, rad, in [-pi/2, pi/2]."""

def atan2(y: float, x: float) -> float:
    """angle of the point (x, y), rad, in [-pi, pi]."""

def sinh(x: float) -> float:
    """hyperbolic sine."""

def cosh(x: float) -> float:
    """hyperbolic cosine."""

def tanh(x: float) -> float:
    """hyperbolic tangent, in [-1, 1]."""

def exp(x: float) -> float:
    """e to the x."""

def expm1(x: float) -> float:
    """e to the x, minus 1, accurate near 0."""

def log(x: float) -> float:
    """natural logarithm."""

def log1p(x: float) -> float:
    """natural logarithm of 1 + x, accurate near 0."""

def log2(x: float) -> float:
    """logarithm to base 2."""

def log10(x: float) -> float:
    """logarithm to base 10."""

def pow(x: float, y: float) -> float:
    """x to the y, as IEEE 754 defines it."""

def cbrt(x: float) -> float:
    """cube root, with the sign of x."""

def hypot(x: float, y: float) -> float:
    """sqrt(x*x + y*y), without overflow on the way."""

def floor(x: float) -> float:
    """the integer toward -inf, as a float."""

def ceil(x: float) -> float:
    """the integer toward +inf, as a float."""

def trunc(x: float) -> float:
    """the integer toward zero, as a float."""

def round(x: float) -> float:
    """the nearest integer, halves to the even one, as a float."""

def fmod(x: float, y: float) -> float:
    """x - y*trunc(x/y), of the real quotient: the remainder with the sign of x (`%` has that of y)."""

def copysign(x: float, y: float) -> float:
    """|x| with the sign of y."""

def lerp(a: float, b: float, t: float) -> float:
    """a + t*(b - a): a at t = 0, b at t = 1, both exactly; a wherever a = b; t beyond [0, 1] extrapolates."""

def wrap_angle(x: float) -> float:
    """x - 2*pi*k in [-pi, pi], with the integer k nearest to zero that brings it there; pi is the constant of the type."""

def isnan(x: float) -> bool:
    """True where x is NaN."""

def isinf(x: float) -> bool:
    """True where x is an infinity."""

def isfinite(x: float) -> bool:
    """True where x is neither NaN nor infinite."""

def abs(x: _Number) -> _Number:
    """|x|."""

@overload
def min(a: _Number, b: _Number, *more: _Number) -> _Number:
    """b if b < a else a."""

@overload
def min(x: _Array) -> float:
    """min(x: T[n]) -> T: The least element."""

@overload
def max(a: _Number, b: _Number, *more: _Number) -> _Number:
    """b if b > a else a."""

@overload
def max(x: _Array) -> float:
    """max(x: T[n]) -> T: The greatest element."""

def clamp(x: _Number, low: _Number, high: _Number) -> _Number:
    """min(max(x, low), high)."""

def sign(x: _Number) -> _Number:
    """1, -1, or x itself when it is zero or NaN."""

def where(c: Any, a: _Value, b: _Value) -> _Value:
    """a where c is True, else b; both are evaluated."""

def wrap_i32(x: int) -> int:
    """x of any integer type, modulo 2^32, as i32."""

def wrap_i64(x: int) -> int:
    """x of any integer type, modulo 2^64, as i64."""

def wrap_u32(x: int) -> int:
    """x of any integer type, modulo 2^32, as u32."""

def wrap_u64(x: int) -> int:
    """x of any integer type, modulo 2^64, as u64."""

def sat_i32(x: float) -> int:
    """x toward zero, or the value of i32 that is nearest to it."""

def sat_i64(x: float) -> int:
    """x toward zero, or the value of i64 that is nearest to it."""

def sat_u32(x: float) -> int:
    """x toward zero, or the value of u32 that is nearest to it."""

def sat_u64(x: float) -> int:
    """x toward zero, or the value of u64 that is nearest to it."""

def wrap_add(a: int, b: int) -> int:
    """a + b modulo 2^n, n the width of the type."""

def wrap_sub(a: int, b: int) -> int:
    """a - b modulo 2^n, n the width of the type."""

def wrap_mul(a: int, b: int) -> int:
    """a * b modulo 2^n, n the width of the type."""

def sat_add(a: int, b: int) -> int:
    """a + b, or the end of the type's range that it is beyond."""

def sat_sub(a: int, b: int) -> int:
    """a - b, or the end of the type's range that it is beyond."""

def sat_mul(a: int, b: int) -> int:
    """a * b, or the end of the type's range that it is beyond."""

def hw_read_gpio(pin: int) -> bool:
    """level of a digital input; false without hardware."""

def hw_write_gpio(pin: int, level: bool) -> None:
    """sets a digital output."""

def hw_read_adc(channel: int) -> int:
    """raw counts of an analogue input; 0 without hardware."""

def hw_read_u32(address: int) -> int:
    """value of a board register or port; 0 without hardware."""

def hw_write_u32(address: int, value: int) -> None:
    """sets a board register or port."""

def event(
    text: str, *values: bool | float | Health, severity: Literal["debug", "info", "warning", "error"] = "info"
) -> None:
    """reports what happened, with up to four scalars, once this run of `execute` completes; severity: "debug", "info", "warning" or "error"."""

def dot(a: _Array, b: _Array) -> float:
    """dot(a: F[n], b: F[n]) -> F: Σᵢ aᵢ bᵢ."""

def norm(a: _Array) -> float:
    """norm(a: F[n]) -> F: √(a·a), the Euclidean length."""

def normalize(a: _Array) -> _Array:
    """normalize(a: F[n]) -> F[n]: a / ‖a‖."""

def cross3(a: _Array, b: _Array) -> _Array:
    """cross3(a: F[3], b: F[3]) -> F[3]: a × b."""

def skew(v: _Array) -> _Array:
    """skew(v: F[3]) -> F[3][3]: The matrix of a cross product: skew(v) w = v × w."""

def outer(a: _Array, b: _Array) -> _Array:
    """outer(a: F[n], b: F[m]) -> F[n][m]: a bᵀ."""

def trace(a: _Array) -> float:
    """trace(a: F[n][n]) -> F: Σᵢ aᵢᵢ."""

def diag(d: _Array) -> _Array:
    """diag(d: F[n]) -> F[n][n]: The matrix with d on its diagonal and zeros elsewhere."""

def transpose(a: _Array) -> _Array:
    """transpose(a: F[n][m]) -> F[m][n]: aᵀ."""

def matvec(a: _Array, x: _Array) -> _Array:
    """matvec(a: F[n][m], x: F[m]) -> F[n]: a x."""

def matmul(a: _Array, b: _Array) -> _Array:
    """matmul(a: F[n][k], b: F[k][m]) -> F[n][m]: a b."""

def symmetric_product(a: _Array, b: _Array) -> _Array:
    """symmetric_product(a: F[n][k], b: F[k][n]) -> F[n][n]: a b where that is symmetric, as (F P) Fᵀ is for a symmetric P: its upper triangle, mirrored. The result is symmetric in"""

def inv(a: _Array) -> _Array:
    """inv(a: F[n][n]) -> F[n][n]: a⁻¹ by Gauss-Jordan elimination with partial pivoting. To solve a system, `solve` is cheaper and more accurate."""

def det(a: _Array) -> float:
    """det(a: F[n][n]) -> F: |a|, the determinant, by Gaussian elimination with partial pivoting."""

def lu_solve(a: _Array, b: _Array) -> _Array:
    """lu_solve(a: F[n][n], b: F[n][m]) -> F[n][m]: x with a x = b for every column of b, by Gaussian elimination with partial pivoting."""

def ldl_solve(a: _Array, b: _Array) -> _Array:
    """ldl_solve(a: F[n][n], b: F[n][m]) -> F[n][m]: x with a x = b for every column of b, for a symmetric and positive definite a, by elimination of one half of it without"""

def solve(a: _Array, b: _Array) -> _Array:
    """solve(a: F[n][n], b: F[n]) -> F[n]: x with a x = b."""

def cholesky(a: _Array) -> _Array:
    """cholesky(a: F[n][n]) -> F[n][n]: The lower triangular L with L Lᵀ = a, for a symmetric and positive definite a. Only its lower triangle is read."""

def quat_mul(p: _Array, q: _Array) -> _Array:
    """quat_mul(p: F[4], q: F[4]) -> F[4]: p ⊗ q, the Hamilton product: the rotation q, then p."""

def quat_conj(q: _Array) -> _Array:
    """quat_conj(q: F[4]) -> F[4]: q* = (q₀, −q₁, −q₂, −q₃); the inverse of a unit quaternion."""

def quat_normalize(q: _Array) -> _Array:
    """quat_normalize(q: F[4]) -> F[4]: q / ‖q‖."""

def quat_rotate(q: _Array, v: _Array) -> _Array:
    """quat_rotate(q: F[4], v: F[3]) -> F[3]: q v q* for a unit q: body coordinates v in the world."""

def quat_to_dcm(q: _Array) -> _Array:
    """quat_to_dcm(q: F[4]) -> F[3][3]: Rotation matrix body → world of a unit q: quat_to_dcm(q) v = quat_rotate(q, v)."""

def quat_from_axis_angle(axis: _Array, angle: float) -> _Array:
    """quat_from_axis_angle(axis: F[3], angle: F) -> F[4]: Rotation by angle (rad) about a unit axis: (cos(angle/2), axis sin(angle/2))."""

def quat_turn(q: _Array, turn: _Array) -> _Array:
    """quat_turn(q: F[4], turn: F[3]) -> F[4]: q ⊗ exp(turn / 2): the rotation q, turned further by the rotation vector turn (rad, in body axes)."""

def quat_from_euler(roll: float, pitch: float, yaw: float) -> _Array:
    """quat_from_euler(roll: F, pitch: F, yaw: F) -> F[4]: ZYX Euler angles (rad): yaw about z, then pitch about the new y, then roll about the new x."""

def quat_to_euler(q: _Array) -> _Array:
    """quat_to_euler(q: F[4]) -> F[3]: [roll, pitch, yaw] (rad, ZYX) of a unit q."""

def quat_slerp(p: _Array, q: _Array, t: float) -> _Array:
    """quat_slerp(p: F[4], q: F[4], t: F) -> F[4]: The rotation at t on the shortest way from p (t = 0) to q (t = 1), at constant rate; p and q are of unit length."""

@overload
def kf_predict_state(f: _Array, x: _Array) -> _Array:
    """kf_predict_state(f: F[n][n], x: F[n]) -> F[n]: x⁻ = F x."""

@overload
def kf_predict_state(f: _Array, x: _Array, b: _Array, u: _Array) -> _Array:
    """kf_predict_state(f: F[n][n], x: F[n], b: F[n][m], u: F[m]) -> F[n]: x⁻ = F x + B u."""

def kf_predict_cov(f: _Array, p: _Array, q: _Array) -> _Array:
    """kf_predict_cov(f: F[n][n], p: F[n][n], q: F[n][n]) -> F[n][n]: P⁻ = F P Fᵀ + Q."""

def kf_gain(p: _Array, h: _Array, r: _Array) -> _Array:
    """kf_gain(p: F[n][n], h: F[m][n], r: F[m][m]) -> F[n][m]: K = P Hᵀ S⁻¹ with the innovation covariance S = H P Hᵀ + R."""

def kf_update_state(x: _Array, k: _Array, z: _Array, h: _Array) -> _Array:
    """kf_update_state(x: F[n], k: F[n][m], z: F[m], h: F[m][n]) -> F[n]: x⁺ = x + K (z − H x)."""

def kf_update_cov(p: _Array, k: _Array, h: _Array) -> _Array:
    """kf_update_cov(p: F[n][n], k: F[n][m], h: F[m][n]) -> F[n][n]: P⁺ = (I − K H) P, for the K of kf_gain."""

def kf_update_cov_joseph(p: _Array, k: _Array, h: _Array, r: _Array) -> _Array:
    """kf_update_cov_joseph(p: F[n][n], k: F[n][m], h: F[m][n], r: F[m][m]) -> F[n][n]: P⁺ = (I − K H) P (I − K H)ᵀ + K R Kᵀ, for any K."""

def sum(x: _Array) -> float:
    """sum(x: F[n]) -> F: Σᵢ xᵢ."""

def mean(x: _Array) -> float:
    """mean(x: F[n]) -> F: Σᵢ xᵢ / n."""

def argmin(x: _Array) -> int:
    """argmin(x: T[n]) -> i64: The index of the least element, of equal ones the first."""

def argmax(x: _Array) -> int:
    """argmax(x: T[n]) -> i64: The index of the greatest element, of equal ones the first."""

def any(x: _Array) -> bool:
    """any(x: bool[n]) -> bool: Whether an element is True."""

def all(x: _Array) -> bool:
    """all(x: bool[n]) -> bool: Whether every element is True."""

def sort(x: _Array) -> _Array:
    """sort(x: F[n]) -> F[n]: The elements in ascending order."""

def median(x: _Array) -> float:
    """median(x: F[n]) -> F: The middle element of sort(x), or the mean of the two."""

def interp_cell(x: float, xs: _Array) -> int:
    """interp_cell(x: F, xs: F[n]) -> i64: The i for which xᵢ ≤ x < xᵢ₊₁; 0 below all breakpoints, n − 2 above."""

def extrapolate(x: float, xs: _Array, ys: _Array) -> float:
    """extrapolate(x: F, xs: F[n], ys: F[n]) -> F: The line through the two points beside x; beyond the ends the first and the last line go on."""

def interp(x: float, xs: _Array, ys: _Array) -> float:
    """interp(x: F, xs: F[n], ys: F[n]) -> F: The line through the two points beside x; beyond the ends y₀ and yₙ₋₁."""

def extrapolate2(x: float, y: float, xs: _Array, ys: _Array, zs: _Array) -> float:
    """extrapolate2(x: F, y: F, xs: F[n], ys: F[m], zs: F[n][m]) -> F: Bilinear between the four points around (x, y); beyond the ends the outermost cells go on."""

def interp2(x: float, y: float, xs: _Array, ys: _Array, zs: _Array) -> float:
    """interp2(x: F, y: F, xs: F[n], ys: F[m], zs: F[n][m]) -> F: Bilinear between the four points around (x, y), each clamped to its breakpoints."""

def extrapolate3(x: float, y: float, z: float, xs: _Array, ys: _Array, zs: _Array, ws: _Array) -> float:
    """extrapolate3(x: F, y: F, z: F, xs: F[n], ys: F[m], zs: F[k], ws: F[n][m][k]) -> F: Trilinear between the eight points around (x, y, z); beyond the ends the outermost cells go on."""

def interp3(x: float, y: float, z: float, xs: _Array, ys: _Array, zs: _Array, ws: _Array) -> float:
    """interp3(x: F, y: F, z: F, xs: F[n], ys: F[m], zs: F[k], ws: F[n][m][k]) -> F: Trilinear between the eight points around (x, y, z), each clamped to its breakpoints."""
