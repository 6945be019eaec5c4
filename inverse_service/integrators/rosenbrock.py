"""A Rosenbrock method for stiff equations: RODAS of order 4 (3), L-stable; linear systems replace Newton's method.

With J = df/dy and increments u_i of y' = f(t, y):

    u_i/(h gamma) - J u_i = f(t + c_i h, y + sum_j a_ij u_j) + sum_j (c_ij/h) u_j + h d_i f_t
    y_new = y + sum_j a_6j u_j + u_6

u_6 is the estimate of the error. E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (1996), IV.7 and
table IV.10.
"""

from __future__ import annotations

from dataclasses import dataclass

Row = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Rosenbrock:
    """`rows` a_ij, `mixed` c_ij, `nodes` c_i, `slopes` d_i, stage by stage; the last stage ends the step."""

    gamma: float
    rows: tuple[Row, ...]
    mixed: tuple[Row, ...]
    nodes: Row
    slopes: Row
    order: int


_FIFTH = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950)
RODAS = Rosenbrock(
    gamma=0.25,
    rows=(
        (),
        (1.544,),
        (0.9466785280815826, 0.2557011698983284),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817),
        _FIFTH,
        (*_FIFTH, 1.0),
    ),
    mixed=(
        (),
        (-5.6688,),
        (-2.430093356833875, -0.2063599157091915),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
        (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
    ),
    nodes=(0.0, 0.386, 0.21, 0.63, 1.0, 1.0),
    slopes=(0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0),
    order=4,
)
