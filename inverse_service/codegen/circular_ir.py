"""sin and cos as LLVM IR, the same for one number and for SIMD lanes.

Reduction by multiples of pi/2 in three parts with fused multiply-add (Cody and Waite), then the minimax polynomials
of fdlibm on [-pi/4, pi/4]; beyond |x| = 2^26 and where a lane is not finite, the C library's functions. Error below
1.5 units in the last place.
"""

from __future__ import annotations

import struct
from functools import lru_cache

_SINE = (
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
_COSINE = (
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip
# pi/2 as a sum of three doubles, each the nearest to what the ones before leave.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
_TWO_OVER_PI = 0.6366197723675814
_LARGEST = 67108864.0
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to an integer and shows its last bits


@lru_cache(maxsize=8)
def circular_functions(lanes: int) -> tuple[str, dict[str, str]]:
    """(definitions of @circular, declarations that they need)."""
    kind = "double" if lanes == 1 else f"<{lanes} x double>"
    whole = "i64" if lanes == 1 else f"<{lanes} x i64>"
    truth = "i1" if lanes == 1 else f"<{lanes} x i1>"
    suffix = "f64" if lanes == 1 else f"v{lanes}f64"

    def real(value: float) -> str:
        text = f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
        return text if lanes == 1 else f"splat (double {text})"

    def integer(value: int) -> str:
        return str(value) if lanes == 1 else f"splat (i64 {value})"

    lines: list[str] = []

    def new(name: str, text: str) -> str:
        lines.append(f"  %{name} = {text}")
        return f"%{name}"

    def fma(name: str, a: str, b: str, c: str) -> str:
        return new(name, f"call {kind} @llvm.fma.{suffix}({kind} {a}, {kind} {b}, {kind} {c})")

    size = new("size", f"call {kind} @llvm.fabs.{suffix}({kind} %x)")
    small = new("small", f"fcmp ole {kind} {size}, {real(_LARGEST)}")
    if lanes > 1:
        small = new("every", f"call i1 @llvm.vector.reduce.and.v{lanes}i1({truth} {small})")
    lines.append(f"  br i1 {small}, label %near, label %far, !prof !0")
    lines.append("near:")
    shifted = fma("shifted", "%x", real(_TWO_OVER_PI), real(_ROUND))
    count = new("count", f"fsub {kind} {shifted}, {real(_ROUND)}")
    turns = new("turns", f"fneg {kind} {count}")
    rest = fma("r1", turns, real(_HALF_PI[0]), "%x")
    rest = fma("r2", turns, real(_HALF_PI[1]), rest)
    rest = fma("r3", turns, real(_HALF_PI[2]), rest)
    square = new("z", f"fmul {kind} {rest}, {rest}")
    sine = real(_SINE[0])
    for place, coefficient in enumerate(_SINE[1:]):
        sine = fma(f"s{place}", sine, square, real(coefficient))
    cube = new("cube", f"fmul {kind} {square}, {rest}")
    sine = fma("sine", sine, cube, rest)
    cosine = real(_COSINE[0])
    for place, coefficient in enumerate(_COSINE[1:]):
        cosine = fma(f"c{place}", cosine, square, real(coefficient))
    # 1 - z/2 + z^2 C with the rounding of 1 - z/2 put back.
    half = new("half", f"fmul {kind} {square}, {real(0.5)}")
    head = new("head", f"fsub {kind} {real(1.0)}, {half}")
    lost = new("lost", f"fsub {kind} {real(1.0)}, {head}")
    lost = new("tail", f"fsub {kind} {lost}, {half}")
    fourth = new("fourth", f"fmul {kind} {square}, {square}")
    tail = fma("tails", fourth, cosine, lost)
    cosine = new("cosine", f"fadd {kind} {head}, {tail}")
    bits = new("bits", f"bitcast {kind} {shifted} to {whole}")
    odd = new("odd", f"trunc {whole} {bits} to {truth}")
    first = new("first", f"select {truth} {odd}, {kind} {cosine}, {kind} {sine}")
    second = new("second", f"select {truth} {odd}, {kind} {sine}, {kind} {cosine}")
    for name, value, shift in (("sin", first, 0), ("cos", second, 1)):
        quarter = new(f"{name}q", f"add {whole} {bits}, {integer(shift)}")
        high = new(f"{name}h", f"shl {whole} {quarter}, {integer(62)}")
        sign = new(f"{name}s", f"and {whole} {high}, {integer(-(2**63))}")
        raw = new(f"{name}r", f"bitcast {kind} {value} to {whole}")
        turned = new(f"{name}t", f"xor {whole} {raw}, {sign}")
        new(name, f"bitcast {whole} {turned} to {kind}")
    pair = f"{{{kind}, {kind}}}"
    lines += [
        f"  %p1 = insertvalue {pair} poison, {kind} %sin, 0",
        f"  %p2 = insertvalue {pair} %p1, {kind} %cos, 1",
        f"  ret {pair} %p2",
        "far:",
        f"  %slow = call {pair} @circular_far({kind} %x)",
        f"  ret {pair} %slow",
        "}",
    ]
    body = "\n".join([f"define internal {pair} @circular({kind} %x) alwaysinline nounwind memory(none) {{", *lines])
    needs = {
        "fma": f"declare {kind} @llvm.fma.{suffix}({kind}, {kind}, {kind})",
        f"llvm.fabs.{suffix}": f"declare {kind} @llvm.fabs.{suffix}({kind})",
        "sin": "declare double @sin(double) nounwind memory(none)",
        "cos": "declare double @cos(double) nounwind memory(none)",
    }
    if lanes > 1:
        needs[f"llvm.vector.reduce.and.v{lanes}i1"] = f"declare i1 @llvm.vector.reduce.and.v{lanes}i1({truth})"
    weights = '!0 = !{!"branch_weights", i32 1000000, i32 1}'
    return "\n".join([body, _far(lanes, kind, pair), weights]), needs


def _far(lanes: int, kind: str, pair: str) -> str:
    """The C library's sin and cos, lane by lane."""
    lines = [f"define internal {pair} @circular_far({kind} %x) noinline cold nounwind memory(none) {{"]
    if lanes == 1:
        lines += ["  %s0 = call double @sin(double %x)", "  %c0 = call double @cos(double %x)"]
        last = ("%s0", "%c0")
    else:
        last = ("poison", "poison")
        for lane in range(lanes):
            lines.append(f"  %x{lane} = extractelement {kind} %x, i32 {lane}")
            for name, function in (("s", "sin"), ("c", "cos")):
                lines.append(f"  %{name}{lane} = call double @{function}(double %x{lane})")
            lines.append(f"  %vs{lane} = insertelement {kind} {last[0]}, double %s{lane}, i32 {lane}")
            lines.append(f"  %vc{lane} = insertelement {kind} {last[1]}, double %c{lane}, i32 {lane}")
            last = (f"%vs{lane}", f"%vc{lane}")
    lines += [
        f"  %p1 = insertvalue {pair} poison, {kind} {last[0]}, 0",
        f"  %p2 = insertvalue {pair} %p1, {kind} {last[1]}, 1",
        f"  ret {pair} %p2",
        "}",
    ]
    return "\n".join(lines)
