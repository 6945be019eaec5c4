"""Nonzero terms that look like zero, and zero terms that do not look like zero: (text, near)."""

from __future__ import annotations

# 1 - D is 0; with 480 bits D is 0, and with 1440 bits 1.
D = "(0." + "0" * 149 + "1*1" + "0" * 150 + ")"
KNOWN_PRIME = 2**61 - 1

# Terms that are nonzero on the component of the point: (text, near).
TINY = {
    "a short number": ("1/10^390", {}),
    "a number below every precision": ("(1/2)^(10^30)", {}),
    "a number of the form exp": ("exp(-10^9)", {}),
    "a bell far out": ("exp(-x^2)", {"x": "30"}),
    "a tail": ("exp(-x)", {"x": "900"}),
    "a double exponential": ("exp(-exp(x))", {"x": "9"}),
    "a switch": ("exp(-445-245*tanh(1000*x))", {"x": "0"}),
    "one minus a saturated function": ("1-tanh(1000*x)", {"x": "5"}),
    "a steep power": ("x^4000", {"x": "1/1000"}),
    "a huge power": ("x^(10^30)", {"x": "1/2"}),
    "a small power of sin": ("sin(x)^999", {"x": "0.001"}),
    "a small coordinate": ("sin(x)", {"x": "1e-90"}),
    "a small parameter": ("a*exp(x)", {"a": "1e-90", "x": "0"}),
    "a huge parameter beside it": ("exp(x)/a", {"a": "1e90", "x": "0"}),
    "a long argument": ("sin(x/10^300)", {"x": "1/3"}),
    "a cosine near one": ("cos(x/10^200)-1", {"x": "1/3"}),
    "an exponential near one": ("exp(x/10^300)-1", {"x": "1/3"}),
    "a number that knows the precision": (f"exp(-200-490*{D})", {}),
    "Fermat for a known prime": (f"x^{KNOWN_PRIME - 1}-1", {"x": "1/3"}),
    "Fermat written as powers": ("(x^3990)^4050-1", {"x": "1/3"}),
    "the other branch of a square root": ("sqrt(x^2)-x", {"x": "-2"}),
    "the sum that vanishes on the other branch": ("sqrt(x^2)+x", {"x": "2"}),
    "the same of a third root": ("((x^3)^(2/3)+x*(x^3)^(1/3)+x^2)*exp(x)", {"x": "2"}),
    "roots of products": ("sqrt(x)*sqrt(y)+sqrt(x*y)", {"x": "2", "y": "3"}),
    "roots of quotients": ("y*sqrt(x/y)-sqrt(x*y)", {"x": "-2", "y": "-3"}),
    "an absolute value": ("abs(x)-x", {"x": "-2"}),
    "a sign": ("sign(x)-1", {"x": "-2"}),
    "the wrong branch of arcsin": ("asin(sin(x))-x", {"x": "2"}),
    "the wrong branch of arctan": ("atan(x)+atan(1/x)-pi/2", {"x": "-2"}),
    "the wrong sheet of arctan": ("atan(tan(x))-x", {"x": "3"}),
    "a root of numbers with the wrong sign": ("sqrt(2)*sqrt(3)+sqrt(6)+0*exp(x)", {}),
    "almost a root of unity": ("cos(pi/5)-sin(pi/5)", {}),
    "a shift below the digits": ("log(x^2)-2*log(x)-1/10^300", {"x": "2"}),
    "two values of one function": ("A(x)-A(x+1/10^200)+0*exp(x)", {"x": "2"}),
    "a parameter under a root": ("sqrt(a^2)-a", {"a": "-2"}),
}  # fmt: skip

# Terms that are zero: (text, near).
HIDDEN = {
    "Pythagoras": ("sin(x)^2+cos(x)^2-1", {}),
    "half an angle": ("sin(2*x)-2*sin(x)*cos(x)", {}),
    "exponents added": ("exp(x+y)-exp(x)*exp(y)", {}),
    "logarithms added": ("log(x*y)-log(x)-log(y)", {"x": "2", "y": "3"}),
    "roots of a power": ("x^(1/2)*x^(1/3)-x^(5/6)", {"x": "2"}),
    "a square root of a square": ("sqrt(x^2)-x", {"x": "2"}),
    "a root with a square in it": ("sqrt(x^2*y^2+x^2)-x*sqrt(y^2+1)", {"x": "1", "y": "1"}),
    "arcsin of sin": ("asin(sin(x))-x", {"x": "0.3"}),
    "two arctangents": ("atan(x)+atan(1/x)-pi/2", {"x": "2"}),
    "arcsin and arccos": ("asin(x)+acos(x)-pi/2", {"x": "0.3"}),
    "hyperbolic functions": ("cosh(x)^2-sinh(x)^2-1", {}),
    "roots of numbers": ("sqrt(8)-2*sqrt(2)", {}),
    "nested roots of numbers": ("sqrt(3+2*sqrt(2))-1-sqrt(2)", {}),
    "logarithms of numbers": ("log(6)-log(2)-log(3)", {}),
    "cosine of a fifth": ("cos(pi/5)-(1+sqrt(5))/4", {}),
    "a huge power twice": ("x^5000-x^2500*x^2500*1", {"x": "2"}),
    "a huge power of a power": ("x^20000-(x^4000)^5", {"x": "2"}),
    "one function at one place": ("A(sqrt(x^2))-A(x)", {"x": "2"}),
    "one function at places added": ("A(x+y)-A(y+x)+0*exp(x)", {}),
    "a number that is one": (f"1-{D}+0*exp(1)", {}),
}  # fmt: skip
