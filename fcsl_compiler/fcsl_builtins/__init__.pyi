# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, for editors and type checkers."""

# Made by test/test_builtins_module.py from the compiler's own tables. Do not edit.
from builtins import bool as bool
from typing import Any, TypeAlias, TypeVar

_Number = TypeVar("_Number", int, float)
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

class _Requests(type):
    def __getattr__(cls, name: str) -> TransitionRequest: ...

class TransitionRequest(metaclass=_Requests):
    """A request of the machine JSON by its name, such as TransitionRequest.START_COAST; or none."""

class Health:
    """How an instance fares."""

    nominal: Health
    degraded: Health
    failed: Health
    stale: Health

def zeros(*sizes: int) -> _Array:
    """an f64 array of zeros; sizes are constants."""

def eye(n: int) -> _Array:
    """the n×n identity, f64."""

def abs(x: _Number) -> _Number:
    """|x|; the smallest integer faults."""

def sqrt(x: float) -> float:
    """correctly rounded; negative x gives NaN."""

def sin(x: float) -> float:
    """sine of x rad; correctly rounded."""

def cos(x: float) -> float:
    """cosine of x rad; correctly rounded."""

def tan(x: float) -> float:
    """tangent of x rad; correctly rounded."""

def asin(x: float) -> float:
    """arc sine, rad; NaN outside [-1, 1]; correctly rounded."""

def acos(x: float) -> float:
    """arc cosine, rad; NaN outside [-1, 1]; correctly rounded."""

def atan(x: float) -> float:
    """arc tangent, rad; correctly rounded."""

def exp(x: float) -> float:
    """e to the x; correctly rounded."""

def log(x: float) -> float:
    """natural logarithm; -inf at 0, NaN below; correctly rounded."""

def atan2(y: float, x: float) -> float:
    """angle of the point (x, y), rad, in [-pi, pi]; correctly rounded."""

def pow(x: float, y: float) -> float:
    """x to the y as IEEE 754 defines it; correctly rounded."""

def hypot(x: float, y: float) -> float:
    """sqrt(x*x + y*y) without overflow on the way; correctly rounded."""

def floor(x: float) -> float:
    """the integer toward -inf, as a float."""

def ceil(x: float) -> float:
    """the integer toward +inf, as a float."""

def trunc(x: float) -> float:
    """the integer toward zero, as a float."""

def isnan(x: float) -> bool:
    """x is NaN."""

def isfinite(x: float) -> bool:
    """x is neither NaN nor infinite."""

def min(a: _Number, b: _Number, *more: _Number) -> _Number:
    """b if b < a else a, so a NaN in b is passed over and one in a stays."""

def max(a: _Number, b: _Number, *more: _Number) -> _Number:
    """b if b > a else a."""

def clamp(x: _Number, low: _Number, high: _Number) -> _Number:
    """low if x < low else high if high < x else x; NaN passes through."""

def sign(x: _Number) -> _Number:
    """1, -1, or x itself when it is zero or NaN."""

def dot(a: _Array, b: _Array) -> float:
    """dot(a: f64[n], b: f64[n]) -> f64: Σᵢ aᵢ bᵢ."""

def norm(a: _Array) -> float:
    """norm(a: f64[n]) -> f64: √(a·a); overflows where a·a does."""

def normalize(a: _Array) -> _Array:
    """normalize(a: f64[n]) -> f64[n]: a / ‖a‖; NaN when a is zero."""

def cross3(a: _Array, b: _Array) -> _Array:
    """cross3(a: f64[3], b: f64[3]) -> f64[3]: a × b."""

def outer(a: _Array, b: _Array) -> _Array:
    """outer(a: f64[n], b: f64[m]) -> f64[n, m]: a bᵀ."""

def trace(a: _Array) -> float:
    """trace(a: f64[n, n]) -> f64: Σᵢ aᵢᵢ."""

def diag(d: _Array) -> _Array:
    """diag(d: f64[n]) -> f64[n, n]: The matrix with d on its diagonal and zeros elsewhere."""

def transpose(a: _Array) -> _Array:
    """transpose(a: f64[n, m]) -> f64[m, n]: aᵀ."""

def matvec(a: _Array, x: _Array) -> _Array:
    """matvec(a: f64[n, m], x: f64[m]) -> f64[n]: a x."""

def matmul(a: _Array, b: _Array) -> _Array:
    """matmul(a: f64[n, k], b: f64[k, m]) -> f64[n, m]: a b. Each element is a sum from left to right; rows are accumulated whole (i, k, j), which changes no element."""

def inv(a: _Array) -> _Array:
    """inv(a: f64[n, n]) -> f64[n, n]: a⁻¹ by Gauss-Jordan elimination with partial pivoting; all NaN when a pivot is exactly zero."""

def quat_mul(p: _Array, q: _Array) -> _Array:
    """quat_mul(p: f64[4], q: f64[4]) -> f64[4]: p ⊗ q (Solà eq. 12)."""

def quat_conj(q: _Array) -> _Array:
    """quat_conj(q: f64[4]) -> f64[4]: q*; the inverse of a unit quaternion."""

def quat_normalize(q: _Array) -> _Array:
    """quat_normalize(q: f64[4]) -> f64[4]: q / ‖q‖; NaN when q is zero."""

def quat_rotate(q: _Array, v: _Array) -> _Array:
    """quat_rotate(q: f64[4], v: f64[3]) -> f64[3]: q v q* for a unit q, as v + w t + u × t with u = (q₁, q₂, q₃), t = 2 u × v."""

def quat_to_dcm(q: _Array) -> _Array:
    """quat_to_dcm(q: f64[4]) -> f64[3, 3]: Rotation matrix body → world of a unit q (Solà eq. 115)."""

def quat_from_axis_angle(axis: _Array, angle: float) -> _Array:
    """quat_from_axis_angle(axis: f64[3], angle: f64) -> f64[4]: Rotation by angle (rad) about a unit axis."""

def quat_from_euler(roll: float, pitch: float, yaw: float) -> _Array:
    """quat_from_euler(roll: f64, pitch: f64, yaw: f64) -> f64[4]: ZYX Euler angles (rad): yaw about z, then pitch about the new y, then roll about the new x."""

def quat_to_euler(q: _Array) -> _Array:
    """quat_to_euler(q: f64[4]) -> f64[3]: [roll, pitch, yaw] (rad, ZYX) of a unit q; at pitch ±π/2 roll and yaw are not unique."""

def kf_predict_state(f: _Array, x: _Array) -> _Array:
    """kf_predict_state(f: f64[n, n], x: f64[n]) -> f64[n]: x⁻ = F x."""

def kf_predict_cov(f: _Array, p: _Array, q: _Array) -> _Array:
    """kf_predict_cov(f: f64[n, n], p: f64[n, n], q: f64[n, n]) -> f64[n, n]: P⁻ = (F P) Fᵀ + Q."""

def kf_gain(p: _Array, h: _Array, r: _Array) -> _Array:
    """kf_gain(p: f64[n, n], h: f64[m, n], r: f64[m, m]) -> f64[n, m]: K = (P Hᵀ) ((H P) Hᵀ + R)⁻¹; all NaN when the innovation covariance is singular."""

def kf_update_state(x: _Array, k: _Array, z: _Array, h: _Array) -> _Array:
    """kf_update_state(x: f64[n], k: f64[n, m], z: f64[m], h: f64[m, n]) -> f64[n]: x⁺ = x + K (z − H x)."""

def kf_update_cov(p: _Array, k: _Array, h: _Array) -> _Array:
    """kf_update_cov(p: f64[n, n], k: f64[n, m], h: f64[m, n]) -> f64[n, n]: P⁺ = (I − K H) P; short, but it drifts from symmetry: prefer the Joseph form for long runs."""

def kf_update_cov_joseph(p: _Array, k: _Array, h: _Array, r: _Array) -> _Array:
    """kf_update_cov_joseph(p: f64[n, n], k: f64[n, m], h: f64[m, n], r: f64[m, m]) -> f64[n, n]: P⁺ = (I − K H) P (I − K H)ᵀ + (K R) Kᵀ: symmetric and positive for any K."""
