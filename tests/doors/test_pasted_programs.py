"""Programs that are run in symbols: bounded in time and size, and strict about what is not evaluated."""

import time
from pathlib import Path

import pytest

from inverse_service.errors import InputError
from inverse_service.reading.scripts import languages, nodes
from inverse_service.service.documents.documents import parse_document
from tests.doors.judge import same_formula

MOVING = "from sympy import *\nt = symbols('t')\nx = Function('x')(t)\nm, k = symbols('m k')\n"
# Each would take for ever, or much of the memory, if it were only evaluated.
HOSTILE = (
    MOVING + "y = x\n" + "y = y + sin(y)\n" * 40 + "L = m*x.diff(t)**2/2 - y\n",
    MOVING + "n = (10**60)**60\nn = n**60\nn = n**60\nL = m*x.diff(t)**2/2 - n*x\n",
    MOVING + "def f(a):\n    return f(f(a))\nL = m*x.diff(t)**2/2 - f(x)\n",
    MOVING + "L = m*x.diff(t)**2/2 - 1e999999999*x\n",
    "let a = 1e999999999;\nfunction f(t, y) { return [y[1], -a*y[0]]; }",
    MOVING + "L = m*x.diff(t)**2/2 - k*sum([1]*10**9)\n",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_a_program_that_grows_without_end_is_given_up(text: str) -> None:
    begin = time.process_time()
    with pytest.raises(nodes.NotRead):
        languages.what_it_comes_to(text)
    assert time.process_time() - begin < 2


@pytest.mark.parametrize(
    "line",
    [
        "L = m*x.diff(t)**2/2 - V(x) if k else 0",
        "for i in range(3):\n    L = m*x.diff(t)**2/2 - i*x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nif k:\n    L = L - x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\ncon = Eq(x.diff(t), k)",
        "L = m*x.diff(t)**2/2 - unknown(x, k, t)",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nif k:\n    pass\nelse:\n    L = L - x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nL //= 2",
        "L = m*x.diff(t)**2/2 - k*x**2/2\ntry:\n    L = L - x\nexcept ValueError:\n    pass",
        "def f(t, y):\n    if y[0] > 1:\n        return [y[1], 0]\n    return [y[1], -y[0]]",
        "eq1 = Eq(m*x.diff(t, 2), -unknown(x))\ny = Function('y')(t)\neq2 = Eq(y.diff(t, 2), -y)",
    ],
)
def test_a_system_that_depends_on_what_is_not_evaluated_is_not_taken(line: str) -> None:
    with pytest.raises(nodes.NotRead):
        languages.what_it_comes_to(MOVING + line)


def test_forces_beside_a_lagrangian_are_kept() -> None:
    text = (
        MOVING
        + "c = symbols('c')\nL = m*x.diff(t)**2/2 - k*x**2/2\n"
        + "eq = Eq(diff(diff(L, x.diff(t)), t) - diff(L, x), -c*x.diff(t))\nsol = dsolve(eq, x)\n"
        + "v = Matrix([x.diff(t)]).dot(Matrix([1]))\n"
    )
    found = languages.what_it_comes_to(text).document
    assert found["equations"] == ["m*x'' + k*x = -c*x'"]


def test_nothing_of_a_program_is_executed(tmp_path: Path) -> None:
    text = f"import os\nos.mkdir({str(tmp_path) + '/made'!r})\nL = open('x').read()\n"
    with pytest.raises(InputError):
        parse_document({"equations": text})
    assert not (tmp_path / "made").exists()


def test_a_value_that_c_defines_is_put_in() -> None:
    text = "#define G 9.81\nvoid f(double t, double y[], double dydt[]) { dydt[0] = y[1]; dydt[1] = -G*sin(y[0]); }"
    assert languages.what_it_comes_to(text).document["parameters"] == []


ODE = "import numpy as np\nfrom scipy.integrate import solve_ivp\n"
PLANE = MOVING + "y = Function('y')(t)\na = symbols('a')\nT = m*x.diff(t)**2/2\n"
FRAMES = (
    "from sympy import *\nfrom sympy.physics.mechanics import *\nq = dynamicsymbols('q')\n"
    "m, l = symbols('m l')\nN = ReferenceFrame('N')\nA = ReferenceFrame('A')\nO = Point('O')\n"
    "O.set_vel(N, 0)\n"
)

# A program, what is meant by x'' (or by the first entry of the state), and a name for the case.
MEANT = {
    "a function sees the names where it is written, not those of its caller": (
        PLANE + "def f(u): return k*u\ndef g(k): return f(x**2)*k\nL = T - g(a)",
        "-2*a*k*x/m",
    ),
    "a function within a function sees the names around it": (
        PLANE
        + "def make(c):\n    def V(u): return c*u**2\n    return V\nc = 7\nL = T - make(a)(x)",
        "-2*a*x/m",
    ),
    "a function that is made twice has the names of each time": (
        PLANE + "def make(c):\n    def V(u): return c*u**2\n    return V\n"
        "L = T - make(a)(x) - make(k)(x)",
        "-2*(a + k)*x/m",
    ),
    "a handle of MATLAB keeps the values of its place": (
        "k = 2;\nf = @(t,y) [y(2); -k*y(1)];\nk = 5;\n[t, y] = ode45(f, [0 1], [1 0]);",
        "-2*y_1",
    ),
    "f[x_] = ... keeps the values of its place": (
        "k = 2;\nV[u_] = k u^2;\nk = 5;\nL = m x'[t]^2/2 - V[x[t]];\nEulerEquations[L, x[t], t]",
        "-4*x/m",
    ),
    "f[x_] := ... does not": (
        "k = 2;\nV[u_] := k u^2;\nk = 5;\nL = m x'[t]^2/2 - V[x[t]];\nEulerEquations[L, x[t], t]",
        "-10*x/m",
    ),
    "an entry of a list is set": (PLANE + "c = [k, a]\nc[0] = 5*a\nL = T - c[0]*x**2", "-10*a*x/m"),
    "a list grows": (
        PLANE + "V = [k*x**2]\nV.append(a*x**2)\nL = T - sum(V)",
        "-2*(k + a)*x/m",
    ),
    "a default value": (PLANE + "def V(u, c=3): return c*u**2\nL = T - V(x)", "-6*x/m"),
    "a default value that is not taken": (
        PLANE + "def V(u, c=3): return c*u**2\nL = T - V(x, c=a)",
        "-2*a*x/m",
    ),
    "a parameter with a name": (
        PLANE + "def V(u, *, k): return k*u**2\nL = T - V(x, k=a)",
        "-2*a*x/m",
    ),
    "a default value of rates": (
        ODE + "def f(t, s, k=2):\n    return [s[1], -k*s[0]]\nsolve_ivp(f, (0, 1), [1, 0])",
        "-2*s_1",
    ),
    "a default value beside args": (
        ODE + "def f(t, s, k=2):\n    return [s[1], -k*s[0]]\n"
        "solve_ivp(f, (0, 1), [1, 0], args=(5,))",
        "-k*s_1",
    ),
    "letters that are constants elsewhere": (
        "from sympy import *\nt, E, I, k = symbols('t E I k')\nx = Function('x')(t)\n"
        "L = E*I*x.diff(t)**2/2 - k*x**2/2",
        "-k*x/(E*I)",
    ),
    "rules that are applied until nothing changes": (
        "L = m x'[t]^2/2 - k x[t]^2 //. {k -> a, a -> 3};\nEulerEquations[L, x[t], t]",
        "-6*x/m",
    ),
    "a name that is cleared is a letter": (
        "k = 2;\nClear[k];\nL = m x'[t]^2/2 - k x[t]^2;\nEulerEquations[L, x[t], t]",
        "-2*k*x/m",
    ),
    "a name that Maple unassigns is a letter": (
        "k := 2:\nk := 'k':\nL := m*diff(x(t),t)^2/2 - k*x(t)^2;\n"
        "eq := diff(m*diff(x(t),t), t) + 2*k*x(t) = 0;\ndsolve(eq);",
        "-2*k*x/m",
    ),
    "a function of each entry": (
        PLANE + "M = Matrix([k*x**2]).applyfunc(lambda e: 2*e)\nL = T - M[0]",
        "-4*k*x/m",
    ),
    "the first entry of a list": (
        "V[u_] := {k u^2, a u};\nL = m x'[t]^2/2 - First[V[x[t]]];\nEulerEquations[L, x[t], t]",
        "-2*k*x/m",
    ),
    "a quotient of whole numbers without a rest": (
        "#include <math.h>\nvoid f(double t, const double *y, double *d) "
        "{ d[0] = y[1]; d[1] = -4/2*y[0]; }",
        "-2*y_1",
    ),
    "a quotient of whole numbers in JavaScript": (
        "const n = 3;\nfunction f(t, y) { return [y[1], -(n/2)*y[0]]; }",
        "-1.5*y_1",
    ),
    "M \\ b of MATLAB": (
        "function dz = f(t, z)\nm1 = 2; k = 3; c = 5;\nM = [m1 0; 0 1];\nK = [k -1; -1 k];\n"
        "x = z(1:2);\nv = z(3:4);\ndz = [v; M \\ (-c*v - K*x)];\nend",
        "(-5*z_1' - 3*z_1 + z_2)/2",
    ),
    "a block of a matrix": (
        "m = 3; k = 12;\nM = m*eye(2);\nK = [2*k -k; -k 2*k];\nA = [zeros(2) eye(2); -M\\K zeros(2)];\n"
        "f = @(t,y) A*y;\n[t,y] = ode45(f, [0 10], [1;0;0;0]);",
        "-8*y_1 + 4*y_2",
    ),
    "a full matrix": (
        ODE
        + "def f(t, s):\n    a, b, va, vb = s\n    M = np.array([[2, np.cos(b)], [np.cos(b), 1]])\n"
        "    acc = np.linalg.solve(M, [-a, -b])\n    return [va, vb, acc[0], acc[1]]\n"
        "solve_ivp(f, (0, 1), [1, 0, 0, 0])",
        "(-a + b*cos(b))/(2 - cos(b)^2)",
    ),
    "a product of arrays": (
        ODE
        + "M = np.array([[2.0, 1.0], [1.0, 3.0]])\nK = np.array([[4.0, 0.0], [0.0, 5.0]])\ndef f(t, y):\n"
        "    a = -np.linalg.inv(M) @ K @ y[:2]\n    return [y[2], y[3], a[0], a[1]]\n"
        "solve_ivp(f, (0, 1), [1, 0, 0, 0])",
        "-(12*y_1 - 5*y_2)/5",
    ),
    "a product of arrays by dot": (
        ODE + "A = np.array([[0, 1], [2, 0]])\nB = np.array([[3, 0], [0, 4]])\ndef f(t, y):\n"
        "    a = -np.dot(np.dot(A, B), y[:2])\n    return [y[2], y[3], a[0], a[1]]\n"
        "solve_ivp(f, (0, 1), [1, 0, 0, 0])",
        "-4*y_2",
    ),
    "a mass matrix of a solver": (
        "M = diag([1 1 3 2]);\nf = @(t,y) [y(3); y(4); -(y(1)-y(2)); y(1)-y(2)];\n"
        "opts = odeset('Mass', M, 'RelTol', 1e-8);\n[t,y] = ode45(f, [0 10], [1 0 0 0], opts);",
        "-(y_1 - y_2)/3",
    ),
    "forces beside a Lagrangian": (
        PLANE + "L = T - k*x**2/2\nF = -a*x.diff(t)\n"
        "eq = Eq(L.diff(x.diff(t)).diff(t) - L.diff(x), F)",
        "-(k*x + a*x')/m",
    ),
}


@pytest.mark.parametrize(("text", "meant"), MEANT.values(), ids=MEANT)
def test_a_program_means_what_its_language_says(text: str, meant: str) -> None:
    found = parse_document({"equations": text})
    name = found["coordinates"][0]
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


STEPS = "import numpy as np\nk = 2.0\nm = 3.0\nc = 0.5\ndt = 0.01\nx = 1.0\nv = 0.0\n"
KEPLER = "-4*r_1/(r_1^2 + r_2^2)^(3/2)"
# Programs that move their state by themselves, by the method of each.
BY_STEPS = {
    "Euler's": (
        STEPS + "for i in range(9):\n    a = (-k*x - c*v)/m\n    x = x + v*dt\n    v = v + a*dt",
        "-(4*x + x')/6",
    ),
    "a step of 1": ("let x = 1, v = 0;\nfunction draw() { v -= 2*x; x += v; }", "-2*x"),
    "two names of steps": (
        STEPS + "h = 5.0\nfor i in range(9):\n    x += v*dt\n    v += -h*x*dt",
        "-5*x",
    ),
    "Runge and Kutta's": (
        STEPS
        + "def f(x, v):\n    return v, -k*x/m - c*v\nfor i in range(9):\n    k1, l1 = f(x, v)\n"
        "    k2, l2 = f(x + dt/2*k1, v + dt/2*l1)\n    k3, l3 = f(x + dt/2*k2, v + dt/2*l2)\n"
        "    k4, l4 = f(x + dt*k3, v + dt*l3)\n    x += dt/6*(k1 + 2*k2 + 2*k3 + k4)\n"
        "    v += dt/6*(l1 + 2*l2 + 2*l3 + l4)",
        "-(4*x + 3*x')/6",
    ),
    "wrong weights of stages": (
        STEPS + "def f(x, v):\n    return v, -k*x/m\nfor i in range(9):\n    k1, l1 = f(x, v)\n"
        "    k2, l2 = f(x + dt/2*k1, v + dt/2*l1)\n    x += dt*(k1 + k2)\n    v += dt*(l1 + l2)",
        "-8*x/3",
    ),
    "half kicks": (
        STEPS
        + "for i in range(9):\n    w = v - 0.5*dt*k*x/m\n    x = x + dt*w\n    v = w - 0.5*dt*k*x/m",
        "-2*x/3",
    ),
    "velocity Verlet, with the acceleration of the step before": (
        STEPS + "a = -k*x\nwhile True:\n    x += v*dt + 0.5*a*dt**2\n    b = -k*x\n"
        "    v += 0.5*(a + b)*dt\n    a = b",
        "-2*x",
    ),
    "Verlet's, with friction": (
        STEPS + "xo = x - v*dt\nfor i in range(9):\n    a = -k*x/m - c*(x - xo)/dt\n"
        "    xn = 2*x - xo + a*dt**2\n    xo = x\n    x = xn",
        "-(4*x + 3*x')/6",
    ),
    "Verlet's, in an array": (
        "import numpy as np\nN = 100\ndt = 0.1\nw = 2.0\nx = np.zeros(N)\nfor n in range(1, N-1):\n"
        "    x[n+1] = 2*x[n] - x[n-1] - dt**2*w**2*np.sin(x[n])",
        "-4*sin(x)",
    ),
    "arrays, with the step before": (
        "N = 100; dt = 0.1; w = 2;\nx = zeros(1, N); v = zeros(1, N);\nx(1) = 1;\nfor n = 2:N\n"
        "  v(n) = v(n-1) - w^2*x(n-1)*dt;\n  x(n) = x(n-1) + v(n)*dt;\nend",
        "-4*x",
    ),
    "arrays of vectors": (
        "import numpy as np\nN = 1000\ndt = 0.01\nr = np.zeros((N, 2))\nv = np.zeros((N, 2))\n"
        "r[0,:] = [1, 0]\nfor i in range(N-1):\n    d = np.sqrt(r[i,0]**2 + r[i,1]**2)\n"
        "    v[i+1,0] = v[i,0] - 4*r[i,0]/d**3*dt\n    v[i+1,1] = v[i,1] - 4*r[i,1]/d**3*dt\n"
        "    r[i+1,:] = r[i,:] + v[i+1,:]*dt",
        KEPLER,
    ),
    "vectors": (
        "import numpy as np\ndef acceleration(r):\n    return -4*r/np.linalg.norm(r)**3\n"
        "r = np.array([1.0, 0.0])\nv = np.array([0.0, 1.0])\ndt = 0.01\na = acceleration(r)\n"
        "for n in range(9):\n    r = r + v*dt + 0.5*a*dt**2\n    b = acceleration(r)\n"
        "    v = v + 0.5*(a + b)*dt\n    a = b",
        KEPLER,
    ),
    "a force that is no list of rates": (
        "import numpy as np\ndef acc(r):\n    return np.array([r[1], -r[0]])\nr = np.array([1.0, 0.0])\n"
        "v = np.array([0.0, 1.0])\ndt = 0.01\nfor i in range(9):\n    v = v + acc(r)*dt\n    r = r + v*dt",
        "r_2",
    ),
    "a time that is counted": (
        STEPS
        + "for i in range(1000):\n    t = i*dt\n    a = -k*x/m + np.cos(2*t)\n    v += a*dt\n    x += v*dt",
        "-2*x/3 + cos(2*t)",
    ),
    "a constant that is called as a time": (
        STEPS + "tau = 0.5\nfor i in range(9):\n    v += (-k*x - v/tau)*dt\n    x += v*dt",
        "-2*x - 2*x'",
    ),
    "a mass that changes in time": (
        STEPS
        + "t = 0\nwhile t < 1:\n    M = m - 0.1*t\n    v += -k*x/M*dt\n    x += v*dt\n    t += dt",
        "-2*x/(3 - t/10)",
    ),
    "work that is added up": (
        STEPS
        + "W = 0\nfor i in range(9):\n    F = -k*x\n    v += F/m*dt\n    x += v*dt\n    W += F*v*dt",
        "-2*x/3",
    ),
    "a function with global": (
        STEPS
        + "def step():\n    global x, v\n    F = -k*x - c*v\n    v = v + F/m*dt\n    x = x + v*dt\n"
        "for i in range(9):\n    step()",
        "-(4*x + x')/6",
    ),
    "two at once, and a loop alone": (
        "x, v = 1.0, 0.0\ndt = 0.01\nfor i in range(9):\n    x, v = x + v*dt, v - 4*x*dt",
        "-4*x",
    ),
    "a step that is solved for": (
        "x = 1.0\nv = 0.0\ndt = 0.01\nfor i in range(9):\n    v = (v - 2*x*dt)/(1 + 0.5*dt)\n    x += v*dt",
        "-2*x - x'/2",
    ),
    "a drag per step in time": (
        "x = 1.0\nv = 0.0\ndt = 0.01\nfor i in range(9):\n    v *= 1 - 0.3*dt\n    v -= x*dt\n    x += v*dt",
        "-x - 3*x'/10",
    ),
    "a force that the loop does not change": (
        "x = 2.0\nv = 0.0\ndt = 0.01\nF = -3*x\nfor i in range(9):\n    v += F*dt\n    x += v*dt",
        "-6",
    ),
    "places alone": (
        "old = 1.0\nx = 1.0\ndt = 0.01\nfor i in range(9):\n    new = 2*x - old - 9*x*dt**2\n"
        "    old = x\n    x = new",
        "-9*x",
    ),
    "functions of C": (
        "#include <stdio.h>\ndouble f(double t, double x, double v) { double m; m = 2.0; return (-x - 0.5*v)/m; }\n"
        "int main(void) {\n double t, dt, x, v, k[2];\n t = 0.0; dt = 0.01; x = 1.0; v = 0.0;\n while (t < 10) {\n"
        "  k[0] = v*dt;\n  k[1] = f(t, x, v)*dt;\n  x = x + k[0];\n  v = v + k[1];\n  t = t + dt;\n }\n return 0;\n}",
        "-(2*x + x')/4",
    ),
}


@pytest.mark.parametrize(("text", "meant"), BY_STEPS.values(), ids=BY_STEPS)
def test_a_program_that_moves_its_state_is_read_from_one_step(text: str, meant: str) -> None:
    found = parse_document({"equations": text})
    name = found["coordinates"][0]
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


JULIA = "using OrdinaryDiffEq\n"
# Programs of Julia, and what is meant by the acceleration of the first coordinate.
OF_JULIA = {
    "all accelerations at once": (
        JULIA + "\u03c9 = 2\nfunction f(ddu,du,u,\u03c9,t)\n    ddu .= -\u03c9^2 * u\nend\n"
        "A = \u221a(2.0)\nprob = SecondOrderODEProblem(f, [0.0], [1.0], (0.0, 1.0), \u03c9)\nsol = solve(prob, DPRKN6())",
        "-omega^2*u_1",
    ),
    "matrices": (
        JULIA + "M = [2.0 0.0; 0.0 1.0]\nK = [3.0 -1.0; -1.0 1.0]\nfunction f!(ddu, du, u, p, t)\n"
        "    ddu .= M \\ (-0.1K*du - K*u)\nend\nprob = SecondOrderODEProblem(f!, [0.0,0.0], [1.0,0.0], (0.0,1.0))",
        "(-(3*u_1' - u_2')/10 - 3*u_1 + u_2)/2",
    ),
    "signs with dots": (
        JULIA + "function f!(ddu,du,u,p,t)\n  ddu .= .-2.0 .* sin.(u) .- 0.1 .* du\nend\n"
        "prob = SecondOrderODEProblem(f!, [0.0,0.0], [1.0,0.5], (0.0,1.0))",
        "-2*sin(u_1) - u_1'/10",
    ),
    "a norm": (
        JULIA
        + "const \u03bc = 4.0\nfunction f!(ddu, du, u, p, t)\n    r = norm(u)\n    @. ddu = -\u03bc * u / r^3\nend\n"
        "prob = SecondOrderODEProblem(f!, [0.0, 7.5], [7.0, 0.0], (0.0, 6.0))",
        "-4*u_1/(u_1^2 + u_2^2)^(3/2)",
    ),
    "accelerations that are returned": (
        JULIA + "f(du,u,p,t) = [-u[1] - 2u[1]*u[2], -u[2] - u[1]^2 + u[2]^2]\n"
        "prob = SecondOrderODEProblem(f, [0.5,0.0], [0.0,0.1], (0.0,1.0))",
        "-u_1 - 2*u_1*u_2",
    ),
    "a Hamiltonian": (
        "using DiffEqPhysics\nH(p,q,params) = p[1]^2/2 + p[2]^2/2 + (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3\n"
        "prob = HamiltonianProblem(H, [0.1, 0.5], [0.0, 0.1], (0.0, 100.0))",
        "-q_1 - 2*q_1*q_2",
    ),
    "the value of a name at the time of the call": (
        JULIA
        + "k = 2.0\nf(du,u,p,t) = -k*u\nk = 5.0\nprob = SecondOrderODEProblem(f, 1.0, 0.0, (0.0,1.0))",
        "-5*u",
    ),
    "a loop": (
        "x, v = 1.0, 0.0\ndt = 0.01\nfor i in 1:9\n    a = -4x - 0.1v\n    global v += a * dt\n    global x += v * dt\nend",
        "-4*x - x'/10",
    ),
}


@pytest.mark.parametrize(("text", "meant"), OF_JULIA.values(), ids=OF_JULIA)
def test_a_program_of_julia_means_what_its_language_says(text: str, meant: str) -> None:
    found = parse_document({"equations": text})
    name = found["coordinates"][0]
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


# Programs of other languages, and what is meant by the acceleration of the first coordinate.
OF_RATES = {
    "R: the order of the initial state": (
        "f <- function(t, state, parms) {\n  with(as.list(c(state, parms)), {\n    dw <- -k*q - cos(t)\n"
        "    dq <- w\n    list(c(dw, dq), power = w*dw)\n  })\n}\nstart <- c(w = 0, q = 1)\n"
        "out <- ode(start, 0:9, f, c(k = 2))",
        "-k*q - cos(t)",
    ),
    "R: a parameter hides a name around the function": (
        "k <- 3\nf <- function(t, s, p) {\n  with(as.list(c(s, p)), list(c(v, -k*x)))\n}\n"
        "out <- ode(y = c(x = 1, v = 0), times = 0:9, func = f, parms = c(k = 2))",
        "-k*x",
    ),
    "MATLAB: E is a letter": (
        "f = @(t, y) [y(2); -E*y(1)/m];\n[t, y] = ode45(f, [0 10], [1 0]);",
        "-E*y_1/m",
    ),
    "R: what has no name is the next argument that is left": (
        "f <- function(t, s, p) {\n  with(as.list(c(s, p)), list(c(-k*x, v)))\n}\n"
        "out <- ode(y = c(v = 0, x = 1), 0:9, f, c(k = 2))",
        "-k*x",
    ),
    "R: a named function takes no place": (
        "f <- function(t, s, p) {\n  with(as.list(c(s, p)), list(c(-k*x, v)))\n}\n"
        "out <- ode(func = f, c(v = 0, x = 1), 0:9, c(k = 2))",
        "-k*x",
    ),
    "R: entries by their names, and an array of zeros": (
        "f <- function(Time, y, p) {\n  d <- numeric(2)\n  d[1] <- y[2] # the rate\n"
        '  d[2] <- -p["k"]*y[1] - p$c*y[2] + sin(Time)\n  return(list(d))\n}',
        "-k*y_1 - c*y_1' + sin(t)",
    ),
    "R: a minus binds less than a power, and a line ends a value": (
        "f <- function(t, y, p) {\n  a <- -2^2*y[1]\n  - 3*y[2]\n  list(c(y[2], a))\n}",
        "-4*y_1",
    ),
    "Fortran: a line that goes on, and numbers of double precision": (
        "subroutine rhs(n, t, y, dy)\n  implicit none\n  real(8), parameter :: k = 4, c = 1.5d-1\n"
        "  real(8) :: t, y(2), dy(2)\n  integer n\n  dy(1) = y(2)\n  dy(2) = -K*y(1) & ! stiff\n"
        "    - c*y(2)\nend subroutine rhs",
        "-4*y_1 - 3*y_1'/20",
    ),
    "Fortran: fixed form, whose time has any name": (
        "      SUBROUTINE FCN(N,X,Z,F)\n      REAL*8 X,Z(N),F(N)\nC     F(2) = 0\n      F(1) = Z(2)\n"
        "      F(2) = -EPS*Z(1)\n     1       + DCOS(X)\n      END",
        "-EPS*Z_1 + cos(t)",
    ),
    "Fortran: a real number over whole ones": (
        "subroutine rhs(t, y, dy)\nreal t, y(2), dy(2)\nk = 3\nm = 2\ndy(1) = y(2)\ndy(2) = -k*y(1)/m\nend",
        "-3*y_1/2",
    ),
    "C: a status, and a number behind a pointer": (
        "int\nrates (double t, const double s[], double ds[],\n   void *par)\n{\n  (void)(t);\n"
        "  double w = *(double *)par;\n  ds[0] = s[1];\n  ds[1] = -w*s[0];\n  return GSL_SUCCESS;\n}",
        "-w*s_1",
    ),
    "C: parts behind a pointer, and a cast": (
        "int rates(double t, const double s[], double ds[], void *par) {\n  int n = 3;\n"
        "  struct par *p = (struct par *)par;\n  ds[0] = s[1];\n"
        "  ds[1] = -p->k/p->m*s[0] - (double)n/2*s[1];\n  return 0;\n}",
        "-k*s_1/m - 3*s_1'/2",
    ),
    "Java: arrays that are made": (
        "public double[] rates(double t, double[] s) {\n  double[] ds = new double[2];\n  ds[0] = s[1];\n"
        "  ds[1] = -9.0*s[0];\n  return ds;\n}",
        "-9*s_1",
    ),
    "JavaScript: a function without a name": (
        "const rates = function(t, s) {\n  return [s[1], -Math.sin(s[0])];\n};",
        "-sin(s_1)",
    ),
    "JavaScript: a list that is taken apart": (
        "const rates = (t, [q, v]) => {\n  const { k, m } = parts;\n  return [v, -k/m*q];\n};",
        "-k*q/m",
    ),
    "TypeScript": (
        "type State = [number, number];\nconst rates = (t: number, s: State): State => {\n"
        "  const [q, v]: State = s;\n  const k: number = 3;\n  return [v, -k * q] as State;\n};",
        "-3*q",
    ),
    "JavaScript: lines that move a state by steps of 1": (
        "let a = -k * sin(q);\na -= c * w;\nw += a;\nq += w;",
        "-k*sin(q) - c*q'",
    ),
    "Julia: a function without another mark of its language": (
        "const k, c = 3, 2\nfunction rates(ds, s, p, t)\n  ds[1] = s[2]\n  ds[2] = -k*s[1] - c*s[2]\nend",
        "-3*s_1 - 2*s_1'",
    ),
    "Mathematica: a table of equations": (
        "n = 2;\neqs = Table[q[i]''[t] == -k (q[i][t] - q[i + 1][t]), {i, n}] /. q[3][t] -> 0",
        "-k*(q_1 - q_2)",
    ),
    "Maxima: a block with names of its own": (
        "L : 5$\neqs : block([L], depends(q, t), L : m*diff(q,t)^2/2 - k*q^2/2,\n"
        "  [diff(diff(L, diff(q,t)), t) - diff(L, q) = 0]);",
        "-k*q/m",
    ),
    "Fortran: an acceleration that a function returns": (
        "real(8) function accel(q, v)\n  real(8) :: q, v\n  accel = -4*q - v\nend function",
        "-4*q - q'",
    ),
    "C++: a structure that is called": (
        "struct osc {\n  double w = 3;\n  void operator()(const vec &s, vec &ds, const double t) {\n"
        "    ds[0] = s[1];\n    ds[1] = -w*s[0];\n  }\n};",
        "-3*s_1",
    ),
    "Modelica: loops of equations, and arrays": (
        "model Row\n  parameter Integer n = 3;\n  parameter Real m[n] = {1, 2, 4};\n  Real q[n], v[n];\n"
        "equation\n  der(q) = v;\n  for i in 1:n loop\n    m[i]*der(v[i]) = -i*q[i];\n  end for;\nend Row;",
        "-q_1",
    ),
    "Modelica: variables that are not differentiated": (
        'model Lift\n  import Modelica.Units.SI;\n  SI.Length h(start = 1) "height";\n  SI.Velocity v;\n'
        '  SI.Acceleration a;\n  Real F = -3*v + cos(time);\n  parameter Real m(unit = "kg") = 2;\n'
        "initial equation\n  v = 0;\nequation\n  v = der(h);\n  a = der(v);\n  m*a = F - 4*h;\nend Lift;",
        "(-3*h' + cos(t) - 4*h)/2",
    ),
    "Go: lists, and names for the entries": (
        "func rates(t float64, s []float64) []float64 {\n\tq, v := s[0], s[1]\n\tk, m := 3.0, 2.0\n"
        "\treturn []float64{v, -k/m*math.Sin(q) -\n\t\tv}\n}",
        "-3*sin(q)/2 - q'",
    ),
    "Go: an array that is set": (
        "const g = 9.81\n\nfunc (p *Body) rates(t float64, y, dy []float64) {\n\tdy[0] = y[1]\n"
        "\tdy[1] = -g\n\tdy[1] -= p.c * y[1]\n}",
        "-9.81 - c*y_1'",
    ),
}


@pytest.mark.parametrize(("text", "meant"), OF_RATES.values(), ids=OF_RATES)
def test_a_program_of_another_language_means_what_it_says(text: str, meant: str) -> None:
    found = parse_document({"equations": text})
    name = found["coordinates"][0]
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


@pytest.mark.parametrize(
    ("force", "meant"),
    [
        ("-5*norm(b.pos)/mag(b.pos)**2", "-5*b_pos_1/(b_pos_1^2 + b_pos_2^2 + b_pos_3^2)^(3/2)"),
        ("-5*b.pos.hat/b.pos.mag2", "-5*b_pos_1/(b_pos_1^2 + b_pos_2^2 + b_pos_3^2)^(3/2)"),
        ("-3*(b.pos - wall.pos)/b.m", "-3*b_pos_1/2"),
        ("vector(0, -b.pos.y, 0) - b.v", "-b_pos_1'"),
    ],
)
def test_what_a_program_draws_has_parts(force: str, meant: str) -> None:
    text = (
        "from vpython import *\nwall = box(pos=vector(0,0,0))\nb = sphere(pos=vector(1,0,0), radius=0.1)\n"
        f"b.m = 2\nb.v = vector(0,1,0)\ndt = 0.01\nwhile True:\n    rate(100)\n    a = {force}\n"
        "    b.v = b.v + a*dt\n    b.pos += b.v*dt\n"
    )
    found = parse_document({"equations": text})
    name = found["coordinates"][0]
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


@pytest.mark.parametrize(
    ("text", "name", "meant"),
    [
        (
            "var('x y u v t')\nmu = 0.3\nde = [u, v, -x + mu*v, -y - mu*u]\n"
            "P = desolve_system_rk4(de, [x,y,u,v], ics=[0,1,0,0,1], ivar=t, end_points=20)",
            "x",
            "-x + 3*y'/10",
        ),
        (
            "from sympy import *\nm, q, t = symbols('m q t')\nb1, b2, b3 = symbols('b1:4')\n"
            "x, y, z = symbols('x y z', cls=Function)\nr = Matrix([x(t), y(t), z(t)])\nV = r.diff(t)\n"
            "F = m*V.diff(t) - q*V.cross(Matrix([b1, b2, b3]))\nsol = dsolve((F[0], F[1], F[2]))",
            "x",
            "q*(y'*b3 - z'*b2)/m",
        ),
        (
            "model O\n  import SI = Modelica.Units.SI;\n  parameter SI.Mass m = 2;\n  SI.Position x;\n"
            "  SI.Velocity v;\nequation\n  v = der(x);\n  m*der(v) = -6*x;\nend O;",
            "x",
            "-3*x",
        ),
    ],
)
def test_what_a_package_calls_by_its_own_name(text: str, name: str, meant: str) -> None:
    found = parse_document({"equations": text})
    assert same_formula(found["equations"][name]["text"], meant, found["coordinates"])


def test_an_array_beside_a_list_is_a_list() -> None:
    text = (
        "import numpy as np\ndelta_t = 0.01\ndef G(y, t):\n    w, x = y\n    return np.array([-4*x - w, w])\n"
        "def step(y, t, dt):\n    k = G(y, t)\n    l = G(y + 0.5*k*dt, t + 0.5*dt)\n    return dt*(k + l)/2\n"
        "y = np.array([0.0, 1.0])\nfor t in np.arange(0, 9, delta_t):\n    y = y + step(y, t, delta_t)"
    )
    found = parse_document({"equations": text})
    assert same_formula(found["equations"]["x"]["text"], "-4*x - x'", ["x"])


def test_a_name_that_is_only_read_may_be_global() -> None:
    text = (
        ODE
        + "k = 3\ndef f(t, y):\n    global k\n    return [y[1], -k*y[0]]\nsolve_ivp(f, (0, 1), [1, 0])"
    )
    found = parse_document({"equations": text})
    assert same_formula(found["equations"]["y_1"]["text"], "-3*y_1", ["y_1"])


def test_a_function_that_steps_is_read_from_its_loop() -> None:
    text = (
        "import numpy as np\ndef run(a, b, dt, n, k=3):\n    x = np.zeros(n); v = np.zeros(n)\n"
        "    x[0], v[0] = a, b\n    for i in range(n - 1):\n        v[i+1] = v[i] - k*np.sin(x[i])*dt\n"
        "        x[i+1] = x[i] + v[i+1]*dt\n    return x, v\nx, v = run(0.5, 0.0, 0.01, 1000)"
    )
    found = parse_document({"equations": text})
    assert same_formula(found["equations"]["x"]["text"], "-3*sin(x)", ["x"])


def test_rates_that_several_equations_share_are_solved_for() -> None:
    text = "der(x) = v; der(p) = w; 2*der(v) + der(w)*cos(p) = -x; der(v)*cos(p) + der(w) = -sin(p)"
    found = parse_document({"equations": text})
    meant = "(x - sin(p)*cos(p))/(cos(p)^2 - 2)"
    assert same_formula(found["equations"]["x"]["text"], meant, ["x", "p"])
    with pytest.raises(InputError, match="not pairs"):
        parse_document({"equations": "x' + y' = v; 2x' + 2y' = w; v' = -x; w' = -y"})


def test_the_time_may_be_upright_with_its_sign() -> None:
    text = r"\frac{\mathrm{d}^2 r}{\mathrm{d\tau}^2} = -\frac{M}{r^2} + r\left(\frac{\mathrm{d}\phi}{\mathrm{d\tau}}\right)^2"
    found = parse_document({"equations": text + r", \frac{\mathrm{d}^2\phi}{\mathrm{d\tau}^2} = 0"})
    assert same_formula(found["equations"]["r"]["text"], "-M/r^2 + r*phi'^2", ["r", "phi"])


# What decides, and a program in which it does so.
TRAPS = {
    "a name set in a loop or under a condition": (
        "f <- function(t, y, p) {\n  k <- 2\n  if (y[1] > 1) k <- 3\n  list(c(y[2], -k*y[1]))\n}",
        "subroutine f(t, y, d)\nreal t, y(2), d(2), a\na = -y(1)\nif (y(1) > 0) a = 0\n"
        "d(1) = y(2)\nd(2) = a\nend",
        "func f(t float64, y []float64) []float64 {\n\tk := 2.0\n\tif t > 1 {\n\t\tk = 3.0\n\t}\n"
        "\treturn []float64{y[1], -k * y[0]}\n}",
        PLANE + "V = [k*x**2]\nfor i in range(2):\n    V.append(a*x**4)\nL = T - sum(V)",
        PLANE + "V = k*x**2\nif k:\n    def V(u): return a*u\nL = T - V",
        PLANE + "L = T - k*x**2\nwhile True:\n    L = L - a*x\n    break",
        PLANE + "try:\n    c = k\nexcept NameError:\n    c = a\nL = T - c*x**2",
    ),
    "a function that returns under a condition": (
        ODE + "def f(t, y):\n    if y[0] > 1:\n        return [y[1], 0]\n    return [y[1], -y[0]]",
    ),
    "a list with two names that is changed in place": (
        ODE + "def f(t, y):\n    z = y\n    z[0] = 2*y[0]\n    return [y[1], -y[0]]",
        PLANE + "c = [k, a]\nd = c\nd[0] = 5*a\nL = T - c[0]*x**2",
    ),
    "a function that changes names around it": (
        "let k = 2;\nfunction set() { k = 3; }\nfunction f(t, y) { set(); return [y[1], -k*y[0]]; }",
        "var k = 2.0\nfunc f(t float64, y []float64) []float64 {\n\tfunc() { k = 5.0 }()\n"
        "\treturn []float64{y[1], -k*y[0]}\n}",
        PLANE + "c = 2\ndef f(u):\n    global c\n    c = 3\n    return u**2\nL = T - f(x)*c",
        "let k = 2;\nfunction set() { k = 5; return 1; }\nconst c = set();\n"
        "function f(t, y) { return [y[1], -c*k*y[0]]; }",
    ),
    "a quotient of whole numbers, which Fortran rounds": (
        "subroutine f(t, y, d)\nreal t, y(2), d(2)\nk = 1\nd(1) = y(2)\nd(2) = -k/2*y(1)\nend",
        "subroutine f(t, y, d)\nreal t, y(2), d(2)\nd(1) = y(2)\nd(2) = -y(1)**(1/2)\nend",
    ),
    "a power of whole numbers, which Fortran rounds": (
        "subroutine f(t, y, d)\nreal t, y(2), d(2)\nd(1) = y(2)\nd(2) = -2**(-1)*y(1)\nend",
    ),
    "the statement data": (
        "subroutine f(t, y, d)\nreal t, y(2), d(2), w\ndata w /2.0/\nd(1) = y(2)\nd(2) = -w*y(1)\nend",
    ),
    "a quotient of whole numbers, which Go rounds": (
        "const k = 1\nfunc f(t float64, y []float64) []float64 {\n\treturn []float64{y[1], -k/2*y[0]}\n}",
    ),
    "the sign ^ between the digits of whole numbers": (
        "function f(t, y) { return [y[1], -(y[0]^2)]; }",
    ),
    "a name of a block": (
        "let k = 2;\nfunction f(t, y) { let k = 3; { let k = 5; } return [y[1], -k*y[0]]; }",
    ),
    "a macro": (
        "#define K 1/2\nvoid f(double t, double *y, double *d) { d[0] = y[1]; d[1] = -K*y[0]; }",
        "#define SQ(x) x*x\nvoid f(double t, double *y, double *d) { d[0] = y[1]; d[1] = -SQ(y[0]+1); }",
    ),
    "a value under a condition": (
        "model M\n  Real x, v;\nequation\n  der(x) = v;\n  der(v) = if x > 0 then -x else 0;\nend M;",
        "f <- function(t, y, p) {\n  k <- if (t > 1) 2 else 3\n  list(c(y[2], -k*y[1]))\n}",
    ),
    "a part that another model gives": (
        "model M\n  extends Base;\n  Real x, v;\nequation\n  der(x) = v;\n  der(v) = -x;\nend M;",
        "model M\n  input Real u;\n  Real x, v;\nequation\n  der(x) = v;\n  der(v) = u;\nend M;",
    ),
    "another model": (
        "model A\n  Real x, v;\nequation\n  der(x) = v;\n  der(v) = -x;\nend A;\n"
        "model B\n  Real x, v;\nequation\n  der(x) = v;\n  der(v) = -2*x;\nend B;",
    ),
    "a quotient that Julia rounds": (
        "function f(du, u, p, t)\n  k = 1 \u00f7 2\n  du[1] = u[2]\n  du[2] = -k*u[1]\nend",
    ),
    "the sign ->": ("f <- function(t, y, p) {\n  2 -> k\n  list(c(y[2], -k*y[1]))\n}",),
    "a quotient of whole numbers, which C rounds": (
        "#include <math.h>\nint n = 3;\n"
        "void f(double t, const double *y, double *d) { d[0] = y[1]; d[1] = -(n/2)*y[0]; }",
        "#include <math.h>\n"
        "void f(double t, const double *y, double *d) { d[0] = y[1]; d[1] = -(1+2)/2*y[0]; }",
    ),
    "a condition": (
        "V[u_] := k u^2 /; u > 0\nV[u_] := a u^2\nL = m x'[t]^2/2 - V[x[t]];\n"
        "EulerEquations[L, x[t], t]",
    ),
    "a loop, a condition, or a procedure": (
        "L := m*diff(x(t),t)^2/2 - k*x(t)^2;\nif a > 0 then b := 1; L := L - a*x(t); end if;\n"
        "EulerLagrange(L, t, x(t));",
        "depends(x,t)$\nL: m*'diff(x,t)^2/2 - k*x^2$\nif a > 0 then L: L - a*x$\nL;",
    ),
    "the statement match": (PLANE + "L = T - k*x\nmatch 1:\n    case 1:\n        L = T - a*x",),
    "the statement delete": (PLANE + "V = k*x**2\ndel V\nL = T - V",),
    "a value of the step before": (
        STEPS + "a = 0\nwhile True:\n    a = 0.5*a - k*x\n    v += a*dt\n    x += v*dt",
        STEPS + "for i in range(9):\n    v += -k*x*dt\n    v *= 0.99\n    x += v*dt",
        STEPS
        + "xo = x\nfor i in range(9):\n    xn = x + (x-xo)*0.99 - k*x*dt**2\n    xo = x\n    x = xn",
    ),
    "an entry that is counted from the end": (
        ODE + "def f(t, y):\n    return [y[1], -y[-1]]\nsolve_ivp(f, (0, 1), [1, 0])",
    ),
    "a function that is made more than once": (
        ODE + "def make(c):\n    def f(t, s):\n        return [s[1], -c*s[0]]\n    return f\n"
        "one = make(2)\ntwo = make(3)\nsolve_ivp(one, (0, 1), [1, 0])",
    ),
    "a list that is changed in place": (
        "V = {k x[t]^2};\nAppendTo[V, a x[t]];\nL = m x'[t]^2/2 - Total[V];\n"
        "EulerEquations[L, x[t], t]",
    ),
    "a mass matrix": (
        "M = [1 0; 0 2];\nopts = odeset(Mass=M);\n[t,y] = ode45(@f, [0 1], [1 0], opts);\n"
        "function dy = f(t,y)\ndy = [y(2); -3*y(1)];\nend",
        "f <- function(t, y, p) list(c(y[2], -3*y[1]))\n"
        "out <- radau(y = c(1, 0), times = 0:9, func = f, parms = 0, mass = diag(2))",
        "opts = odeset('Mass', @mass);\n[t,y] = ode45(@f, [0 1], [1 0], opts);\n"
        "function dy = f(t,y)\ndy = [y(2); -3*y(1)];\nend\n"
        "function m = mass(t,y)\nm = [1 0; 0 2+y(1)];\nend",
        "function f(du,u,p,t)\n  du[1] = u[2]\n  du[2] = -5*u[1]\nend\nM = [1.0 0; 0 2.0]\n"
        "prob = ODEProblem(ODEFunction(f, mass_matrix=M), [1.0, 0.0], (0.0, 1.0))",
    ),
    "an event that changes the motion": (
        "x'=v\nv'=-k*x\npar k=2\nglobal 1 x {v=-v}\ninit x=1\ndone",
        "dsolve({diff(y(t),t,t) = -9.81, y(0)=1, D(y)(0)=0}, numeric, "
        "events=[[y(t)=0, diff(y(t),t) = -diff(y(t),t)]]);",
        "NDSolve[{y''[t] == -9.81, y[0] == 5, y'[0] == 0, WhenEvent[y[t] == 0, "
        "y'[t] -> -y'[t]]}, y, {t, 0, 10}]",
    ),
    "a constraint": (
        "from sympy.physics.mechanics import *\nfrom sympy import *\nx, y = dynamicsymbols('x y')\n"
        "m, g, l = symbols('m g l')\nL = m*(x.diff()**2 + y.diff()**2)/2 - m*g*y\n"
        "LM = LagrangesMethod(L, [x, y], hol_coneqs=[x**2 + y**2 - l**2])",
    ),
    "a function of the rates and the state that gives accelerations": (
        "using OrdinaryDiffEq\nf(v,u,p,t) = [-sum(u[i] for i in 1:2), -u[2]]\n"
        "prob = SecondOrderODEProblem(f, [0.5,0.0], [0.0,0.1], (0.0,1.0))",
    ),
    "a name for the rest of a list": (PLANE + "b, *c = k, a, x\nL = T - b*x - c[0]*x",),
    "arithmetic with a list that is no array": (PLANE + "c = [k]*3\nV = c[0]*x\nL = T - V",),
}


@pytest.mark.parametrize(
    ("what", "text"),
    [(what, text) for what, texts in TRAPS.items() for text in texts],
)
def test_a_program_that_its_lines_do_not_say_is_refused_at_the_place(what: str, text: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_document({"equations": text})
    assert refused.value.detail.startswith(f"{what} decides what this program comes to")
    assert refused.value.pointer == "/equations"
    assert refused.value.column in range(1, len(text) + 1)


@pytest.mark.parametrize(
    "text",
    [
        FRAMES + "P = O.locatenew('P', l*A.x + q*A.y)\nP.set_vel(N, P.pos_from(O).dt(N))\n"
        "Pa = Particle('Pa', P, m)\nL = Lagrangian(N, Pa)\nLM = LagrangesMethod(L, [q])",
        PLANE + "L = T - k*x**2 - a*x\nL = L.subs({k: a, a: k})",
        PLANE + "L = T - k*Matrix([x, 3]).norm(1)",
        PLANE + "def V(u, c=1): return c*u**2\nopts = {'c': a}\nL = T - V(x, **opts)",
        ODE + "class A:\n    def f(self):\n        return self.k\n"
        "class B:\n    def f(self, t, y):\n        return [y[1], -self.k*y[0]]",
        "x = 1.0\nv = 0.0\nfor i in range(9):\n    v += -x*0.01\n    x += v*0.01",
        STEPS + "k = 1.0\nfor i in range(9):\n    k = k*1.01\n    v += -k*x*dt\n    x += v*dt",
        "x = 1.0\nv = 0.0\ndt = 0.01\nfor i in range(9):\n    v += -x*dt\n    v *= 0.99\n    x += v*dt",
        "x = 1.0\nv = 0.0\ndt = 0.01\nfor i in range(9):\n    v += (0.1*i - x)*dt\n    x += v*dt",
        STEPS + "d = 0.02\nfor i in range(9):\n    v += -k*x*dt\n    x += v*d",
        STEPS
        + "for i in range(9):\n    F = -k*x\n    if x > 1:\n        F = -3*k*x\n    v += F*dt\n    x += v*dt",
        "x = 1.0\nv = 0.0\ndt = 0.01\nfor i in range(9):\n    v += -x*dt\n    x += v*dt\n"
        "    if x < 0:\n        v = -v",
    ],
)
def test_a_program_with_an_uncertain_part_is_not_taken(text: str) -> None:
    with pytest.raises(nodes.NotRead):
        languages.what_it_comes_to(text)


def test_lines_in_which_less_moves_than_in_the_program_do_not_win() -> None:
    """r0 is a function of the time in the program, and a constant by its index."""
    text = (
        "r0 = sp.Function('r_0')(t)\na = sp.Function('a')(t)\nx0 = r0*sp.sin(a)\ny0 = -r0*sp.cos(a)\n"
        "kinetic = m*(x0.diff(t)**2 + y0.diff(t)**2)/2\nL = kinetic - k*(r0 - b)**2/2\n"
    )
    assert [*parse_document({"equations": text})["equations"]] == ["r_0", "a"]


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        (
            "syms q dq ddq u m c k real\nsum = u - k*q - c*dq;\nddqSoln = solve(sum - m*ddq, ddq);",
            {"q": "(u - k*q - c*q')/m"},
        ),
        # a torque, no time, that L alone does not have
        (
            "syms q dq ddq m g l tau real\nL = m*l^2*dq^2/2 + m*g*l*cos(q);\n"
            "e = diff(diff(L, dq), q)*dq + diff(diff(L, dq), dq)*ddq - diff(L, q) - tau;\nsolve(e == 0, ddq)",
            {"q": "-(m*g*l*sin(q) - tau)/(m*l^2)"},
        ),
    ],
)
def test_equations_that_are_solved_for_accelerations_are_those_of_the_motion(
    text: str, motion: dict[str, str]
) -> None:
    found = parse_document({"equations": text})["equations"]
    assert {name: part["text"] for name, part in found.items()} == motion


def test_forces_that_are_not_given_are_not_left_out() -> None:
    text = (
        "q = dynamicsymbols('q')\nqd = dynamicsymbols('q', 1)\nL = m*qd**2/2 - k*q**2/2\n"
        "LM = LagrangesMethod(L, [q], forcelist=forces, frame=N)"
    )
    with pytest.raises(InputError, match="a list of forces"):
        parse_document({"equations": text})
