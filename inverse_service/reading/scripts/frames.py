"""Reference frames, points, particles, and rigid bodies of sympy.physics.mechanics.

A vector is the list of its components in the first frame of the program, which rests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from inverse_service.expressions import tree as ex
from inverse_service.reading import names as nm
from inverse_service.reading.scripts import nodes as nd, values as vs
from inverse_service.reading.scripts.machine import Machine
from inverse_service.reading.scripts.values import Value

Arrow = list[Any]
_AXES = {"x": 0, "y": 1, "z": 2, "1": 0, "2": 1, "3": 2}
_NONE: Arrow = [ex.ZERO, ex.ZERO, ex.ZERO]
_UNIT: tuple[Arrow, ...] = (
    [ex.ONE, ex.ZERO, ex.ZERO], [ex.ZERO, ex.ONE, ex.ZERO], [ex.ZERO, ex.ZERO, ex.ONE],
)  # fmt: skip


@dataclass(slots=True)
class Frame:
    """A frame by its axes (none before it is oriented), and its angular velocity where it is
    known.
    """

    axes: tuple[Arrow, ...] = _UNIT
    spin: Arrow | None = None


@dataclass(slots=True)
class Point:
    """A point by its place, or by a velocity that the program gives it."""

    place: Arrow | None = None
    rate: Arrow | None = None


@dataclass(slots=True)
class Body:
    """A particle, or a rigid body with its moment of inertia in its frame."""

    point: Point
    mass: Value
    frame: Frame | None = None
    inertia: tuple[Value, ...] = ()
    potential: Value = field(default=ex.ZERO)

    def assign(self, name: str, value: Value) -> None:
        if name == "potential_energy":
            self.potential = value


def cross(left: Value, right: Value) -> Value:
    one, other = vs.listed(left), vs.listed(right)
    if one is None or other is None or len(one) != 3 or len(other) != 3:
        raise nd.NotRead("a vector product of something else than vectors")
    (a, b, c), (x, y, z) = one, other
    found = [b * z - c * y, c * x - a * z, a * y - b * x]
    return vs.column(found) if isinstance(left, vs.Matrix) else found


def member(base: Value, name: str) -> Value | None:
    """N.x, and the like."""
    if isinstance(base, Frame) and name in ("x", "y", "z"):
        return base.axes[_AXES[name]]
    if isinstance(base, Body) and name in ("point", "masscenter"):
        return base.point
    if isinstance(base, Body) and name in ("mass", "potential_energy"):
        return base.mass if name == "mass" else base.potential
    return None


def method(machine: Machine, base: Value, name: str, given: Sequence[Value]) -> Value | None:
    """What a method of a frame, point, or body returns, None where it has no such method."""
    if isinstance(base, Frame):
        return _of_frame(machine, base, name, given)
    if isinstance(base, Point):
        return _of_point(machine, base, name, given)
    if isinstance(base, Body) and name == "kinetic_energy":
        return kinetic(machine, base)
    if isinstance(base, Kane):
        return kanes_equations(machine, base, given) if name == "kanes_equations" else None
    if isinstance(base, list) and len(base) == 3:
        if name == "cross":
            return cross(base, given[0])
        if name in ("dt", "diff") and (not given or _rests(given[-1])):
            return machine.in_time(base)
        if name == "magnitude":
            return ex.square_root(vs.scalar(vs.dot(base, base)))
        if name in ("express", "normalize", "simplify"):
            return base if name != "normalize" else None
    if isinstance(base, vs.Matrix) and name == "cross":
        return cross(base, given[0])
    return None


def _rests(value: Value) -> bool:
    return isinstance(value, Frame) and value.axes == _UNIT


def _of_frame(machine: Machine, base: Frame, name: str, given: Sequence[Value]) -> Value | None:
    texts = [one.lower() for one in given if isinstance(one, str)]
    if name == "orientnew":
        found = Frame()
        kind, amounts, *order = given[1:]
        _orient(machine, found, base, str(kind).lower(), amounts, *map(str, order))
        return found
    if name == "orient":
        _orient(machine, base, given[0], texts[0], *[one for one in given[1:] if one != given[1]])
        return ex.ZERO
    if name == "orient_axis":
        axis, angle = given[1:]
        if not isinstance(axis, list):
            axis, angle = angle, axis
        _orient(machine, base, given[0], "axis", [angle, axis])
        return ex.ZERO
    if name == "orient_body_fixed":
        _orient(machine, base, given[0], "body", given[1], str(given[2]))
        return ex.ZERO
    if name == "set_ang_vel":
        base.spin = base.spin or _arrow(given[1])
        return ex.ZERO
    if name == "ang_vel_in":
        return _spin(base, given[0])
    return None


def _spin(frame: Frame, other: Value) -> Arrow:
    if (frame.spin is None and frame.axes != _UNIT) or not _rests(other):
        raise nd.NotRead("an angular velocity that is not known")
    return frame.spin or _NONE


def _orient(
    machine: Machine, new: Frame, old: Frame, kind: str, amounts: Value, order: str = ""
) -> None:
    """Turn a frame by an angle about an axis of another, or by three angles about its own."""
    spin = old.spin if old.spin is not None else (_NONE if old.axes == _UNIT else None)
    axes = old.axes
    if kind == "axis":
        if not isinstance(amounts, list) or len(amounts) != 2:
            raise nd.NotRead("an orientation")
        angle, axis = amounts if isinstance(amounts[1], list) else amounts[::-1]
        turns = [(angle, next((k for k in range(3) if axes[k] == axis), None))]
    elif kind in ("body", "space") and isinstance(amounts, list) and len(amounts) == len(order):
        if kind == "space":
            raise nd.NotRead("an orientation by angles about fixed axes")
        turns = [
            (angle, _AXES.get(letter.lower())) for angle, letter in zip(amounts, order, strict=True)
        ]
    else:
        raise nd.NotRead("an orientation")
    for angle, k in turns:
        if k is None:
            raise nd.NotRead("an axis that is none of the frame's own")
        cosine, sine = (nm.call(name, [vs.scalar(angle)], 1) for name in ("cos", "sin"))
        one, two = axes[(k + 1) % 3], axes[(k + 2) % 3]
        turned = {
            k: axes[k],
            (k + 1) % 3: vs.added(vs.multiplied(cosine, one), vs.multiplied(sine, two)),
            (k + 2) % 3: vs.added(vs.multiplied(cosine, two), vs.multiplied(sine, one), -1),
        }
        axes = tuple(turned[j] for j in range(3))
        rate = vs.multiplied(machine.in_time(angle), axes[k])
        spin = None if spin is None else vs.added(spin, rate)
    new.axes, new.spin = axes, spin


def _arrow(value: Value) -> Arrow:
    if value == ex.ZERO:
        return _NONE
    if not isinstance(value, list) or len(value) != 3:
        raise nd.NotRead("a vector is expected")
    return value


def _of_point(machine: Machine, base: Point, name: str, given: Sequence[Value]) -> Value | None:
    if name == "locatenew":
        place = base.place if base.place is not None else _NONE
        base.place = place
        return Point(vs.added(place, _arrow(given[1])))
    if name == "set_pos":
        other = given[0]
        other.place = other.place if other.place is not None else _NONE
        base.place = vs.added(other.place, _arrow(given[1]))
        return ex.ZERO
    if name == "set_vel":
        if not _rests(given[0]):
            raise nd.NotRead("a velocity in a frame that turns")
        base.rate = _arrow(given[1])
        return ex.ZERO
    if name in ("v2pt_theory", "v1pt_theory"):
        other = given[0]
        if base.place is None or other.place is None or not _rests(given[1]):
            raise nd.NotRead("a velocity in a frame that turns")
        apart = vs.added(base.place, other.place, -1)
        base.rate = vs.added(velocity(machine, other), machine.in_time(apart))
        return base.rate
    if name == "vel":
        return velocity(machine, base)
    if name == "acc":
        return machine.in_time(velocity(machine, base))
    if name == "pos_from":
        if base.place is None or given[0].place is None:
            raise nd.NotRead("a point without a place")
        return vs.added(base.place, given[0].place, -1)
    return None


def velocity(machine: Machine, point: Point) -> Arrow:
    if point.rate is not None:
        return point.rate
    if point.place is None:
        raise nd.NotRead("a point without a velocity")
    found: Arrow = machine.in_time(point.place)
    return found


def kinetic(machine: Machine, body: Body) -> ex.Expression:
    moving = velocity(machine, body.point)
    found = vs.scalar(body.mass) * vs.scalar(vs.dot(moving, moving)) / 2
    if body.frame is not None:
        parts = [vs.dot(_spin(body.frame, Frame()), axis) for axis in body.frame.axes]
        for moment, part in zip(body.inertia, parts, strict=True):
            found = found + vs.scalar(moment) * part**2 / 2
    return found


Given = Sequence[Value]
Named = Mapping[str, Value]


def _frame(machine: Machine, given: Given, named: Named) -> Frame:
    if any(isinstance(held, Frame) for held in machine.names.values()):
        return Frame(axes=())  # until it is oriented
    return Frame(spin=_NONE)


def _particle(machine: Machine, given: Given, named: Named) -> Body:
    point = given[1] if len(given) > 1 else named.get("point")
    mass = given[2] if len(given) > 2 else named.get("mass")
    if not isinstance(point, Point) or mass is None:
        raise nd.NotRead("a particle without a point or a mass")
    return Body(point, mass)


def _rigid(machine: Machine, given: Given, named: Named) -> Body:
    _, point, frame, mass, (inertia, about) = given
    if about is not point or not isinstance(frame, Frame) or inertia[0] is not frame:
        raise nd.NotRead("a moment of inertia about another point than the center of mass")
    return Body(point, mass, frame, tuple(inertia[1:]))


def _inertia(machine: Machine, given: Given, named: Named) -> list[Value]:
    if len(given) != 4:
        raise nd.NotRead("products of inertia")
    return [*given]


def _bodies(given: Given) -> list[Body]:
    bodies = [one for one in given if isinstance(one, Body)]
    if len(bodies) != len(given):
        raise nd.NotRead("bodies that are not known")
    return bodies


def _kinetic(machine: Machine, given: Given, named: Named) -> Value:
    return ex.add(*(kinetic(machine, body) for body in _bodies(given[1:])))


def _potential(machine: Machine, given: Given, named: Named) -> Value:
    return ex.add(*(vs.scalar(body.potential) for body in _bodies(given)))


def _lagrangian(machine: Machine, given: Given, named: Named) -> Value:
    if not given or not _rests(given[0]):
        raise nd.NotRead("a Lagrangian in a frame that turns")
    return _kinetic(machine, given, named) - _potential(machine, given[1:], named)


def _slope(moving: Value, name: str) -> Value:
    """dv/dq'."""
    return vs.each(moving, lambda part: vs.partial(part, ex.Velocity(name)))


def _forces(machine: Machine, loads: Value, names: Sequence[str]) -> list[ex.Expression]:
    """The generalized force of each coordinate."""
    found: list[ex.Expression] = [ex.ZERO for _ in names]
    for load in loads or []:
        where, force = load
        if isinstance(where, Point):
            moving = velocity(machine, where)
        elif isinstance(where, Frame):
            moving = _spin(where, Frame())
        else:
            raise nd.NotRead("a force on something that is no point")
        for k, name in enumerate(names):
            by = _slope(moving, name)
            found[k] = found[k] + vs.scalar(vs.dot(_arrow(force), by))
    return found


def holds_loads(value: Value) -> bool:
    """Whether this is a force on a point or a torque on a frame, or a list of them."""
    if not isinstance(value, list):
        return False
    pair = len(value) == 2 and isinstance(value[0], Point | Frame)
    return (pair and isinstance(value[1], list)) or any(map(holds_loads, value))


def _lagranges_method(machine: Machine, given: Given, named: Named) -> Value:
    if {"hol_coneqs", "nonhol_coneqs"} & {*named} or len(given) < 2:
        raise nd.NotRead("LagrangesMethod with constraints")
    names = [vs.scalar(one) for one in vs.listed(given[1]) or [given[1]]]
    coordinates = [one.name for one in names if isinstance(one, ex.Symbol)]
    loads = named.get("forcelist", given[2] if len(given) > 2 else None)
    forces = _forces(machine, loads, coordinates)
    machine.stated.lagrangians.append((vs.scalar(given[0]), coordinates, forces))
    return Frame()


def _kanes_method(machine: Machine, given: Given, named: Named) -> Value:
    """The equations need the speeds in the rates of the coordinates."""
    if {"configuration_constraints", "velocity_constraints", "u_dependent"} & {*named}:
        raise nd.NotRead("KanesMethod with constraints")
    positions = named.get("q_ind", given[1] if len(given) > 1 else None)
    speeds = named.get("u_ind", given[2] if len(given) > 2 else None)
    rules = named.get("kd_eqs", given[3] if len(given) > 3 else None)
    names = [vs.scalar(one) for one in vs.listed(positions) or []]
    table: dict[ex.Expression, ex.Expression] = {}
    for speed, rule in zip(vs.listed(speeds) or [], vs.listed(rules) or [], strict=False):
        symbol = vs.scalar(speed)
        tree = next(iter(vs.equations_in(rule))).difference
        slope = vs.partial(tree, symbol)
        if not isinstance(slope, ex.Number) or slope == ex.ZERO:
            raise nd.NotRead("a speed that is no rate")
        table[symbol] = -ex.substitute(tree, {symbol: ex.ZERO}) / slope
    loads, bodies = named.get("forcelist"), named.get("bodies")
    return Kane([one.name for one in names if isinstance(one, ex.Symbol)], table, loads, bodies)


@dataclass(slots=True)
class Kane:
    """A KanesMethod that waits for its bodies."""

    names: list[str]
    speeds: dict[ex.Expression, ex.Expression]
    loads: Value
    bodies: Value


def kanes_equations(machine: Machine, kane: Kane, given: Given) -> Value:
    """Newton's law of each body along each coordinate: (F - m a) . dv/dq' = 0 in sum."""
    lists = [one for one in given if isinstance(one, list)] + [kane.bodies, kane.loads]
    bodies = next((one for one in lists if one and isinstance(one[0], Body)), None)
    loads = next((one for one in lists if one and isinstance(one[0], list)), kane.loads)
    if bodies is None or any(body.frame is not None for body in bodies):
        raise nd.NotRead("KanesMethod with rigid bodies")

    def put(value: Value) -> Value:
        return vs.each(value, lambda part: ex.substitute(part, kane.speeds))

    for speed in kane.speeds:
        machine.moving.pop(speed.name if isinstance(speed, ex.Symbol) else "", None)
    found: list[ex.Expression] = [ex.ZERO for _ in kane.names]
    points = [(body.point, put(velocity(machine, body.point)), body.mass) for body in bodies]
    for _, moving, mass in points:
        inertia = vs.multiplied(mass, machine.in_time(moving))
        for k, name in enumerate(kane.names):
            by = _slope(moving, name)
            found[k] = found[k] - vs.scalar(vs.dot(inertia, by))
    for load in loads or []:
        where, force = load
        if not isinstance(where, Point):
            raise nd.NotRead("a torque in KanesMethod")
        moving = put(velocity(machine, where))
        for k, name in enumerate(kane.names):
            by = _slope(moving, name)
            found[k] = found[k] + vs.scalar(vs.dot(put(_arrow(force)), by))
    machine.stated.equations += [vs.Equation(one, ex.ZERO) for one in found]
    return [Frame(), Frame()]


Maker = Callable[[Machine, Given, Named], Value]
MADE: dict[str, Maker] = {
    "ReferenceFrame": _frame,
    "Point": lambda machine, given, named: Point(),
    "Particle": _particle,
    "RigidBody": _rigid,
    "inertia": _inertia,
    "kinetic_energy": _kinetic,
    "potential_energy": _potential,
    "Lagrangian": _lagrangian,
    "LagrangesMethod": _lagranges_method,
    "KanesMethod": _kanes_method,
}
