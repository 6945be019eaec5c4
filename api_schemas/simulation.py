"""The answers of `simulate` and of `work-precision`, where quantities that the scene does not observe are left out."""

from typing import Any, Literal

from pydantic import ConfigDict

from api_schemas import base
from api_schemas.result import AdvicePart

NamedNumbers = dict[str, float | None]
Columns = dict[str, list[float | None]]


class SimulatedSystem(base.Document):
    """A system as it was run: its Lagrangian and constraints, or its equations, and values of the parameters."""

    coordinates: list[str]
    lagrangian: str | None
    constraints: list[str]
    equations: dict[str, str] | None
    effects: list[str]
    parameters: NamedNumbers


class StartPoint(base.Document):
    """Where a motion begins."""

    positions: NamedNumbers
    velocities: NamedNumbers


class FinalPoint(base.Document):
    """Where a motion ends; null where a method has no velocities."""

    t: float
    positions: NamedNumbers | None
    velocities: NamedNumbers | None


class StoppedPart(base.Document):
    """Where and on what a run ended before its last step, and what to change."""

    step: int | None
    time: float | None
    quantity: str | None
    value: float | None
    remedy: str | None
    sentence: str = ""


class PointsPart(base.Document):
    """Recorded points, at most 2001: t, coordinates and observed quantities."""

    every: int
    columns: Columns


class EventPart(base.Document):
    """Where an event was found: t, coordinates and velocities, at most 20,000 points."""

    when: str
    count: int
    columns: Columns
    note: str | None = None


class SwitchPart(base.Document):
    """Passages of sign, abs and pieces: t, the function that is zero, and where it went: above, below or sticks."""

    count: int
    columns: dict[str, list[Any]]


class SpanPart(base.Document):
    """A span of time."""

    begin: float
    end: float


class ContactPart(base.Document):
    """What a contact did: the number of its impacts, the spans in which it pressed, its greatest normal force."""

    name: str
    impacts: int
    rests: list[SpanPart]
    greatest_force: float


class CirclePart(base.Document):
    """Circles through the first and the last revolution of a path, and how far they are apart."""

    radius_first: float
    radius_last: float
    radius_change: float
    centre_drift: float
    misfit: float
    shape_misfit: float | None
    revolutions: float | None
    through_three_points: dict[str, Any] | None
    note: str | None = None
    exact_radius: float | None = None
    max_radial_distance: float | None = None


class SimulatedMethod(base.Document):
    """A method as it was run, with the numbers of what is observed; `..._note` says why one of them is null."""

    model_config = ConfigDict(extra="allow")

    label: str
    method: str
    alpha: str | None
    symmetrised: bool
    order: int | None
    form: str | None
    start: str | None
    outcome: str
    steps: int
    reason: str | None = None
    note: str | None = None
    doubt: str | None = None
    stopped: StoppedPart | None = None
    estimated_error: float | None = None
    estimated_error_share: float | None = None
    estimated_until: float | None = None
    energy_start: float | None = None
    max_energy_error: float | None = None
    max_discrete_energy_error: float | None = None
    work: float | None = None
    max_balance_error: float | None = None
    max_phase_error: float | None = None
    final_phase_error: float | None = None
    action: float | None = None
    energy_parts: NamedNumbers | None = None
    max_constraint: float | None = None
    max_constraint_at_points: float | None = None
    max_momentum_drift: float | None = None
    max_error: float | None = None
    final_error: float | None = None
    error_each: NamedNumbers | None = None
    error_against: str | None = None
    error_uncertainty: float | None = None
    circle: CirclePart | None = None
    constraint_forces: dict[str, Any] | None = None
    contact_forces: dict[str, Any] | None = None
    period: NamedNumbers | None = None
    conserved: dict[str, Any] | None = None
    observables: dict[str, Any] | None = None
    events: list[EventPart] | None = None
    switches: SwitchPart | None = None
    contacts: list[ContactPart] | None = None
    final: FinalPoint | None = None
    free_lagrangian: str | None = None
    free_lagrangian_source: str | None = None
    constants: NamedNumbers | None = None
    force_evaluations: int | None = None
    newton_iterations: int | None = None
    points: PointsPart | None = None
    members: int | None = None
    outcomes: dict[str, int] | None = None
    ended: list[dict[str, Any]] | None = None
    members_columns: Columns | None = None
    seconds: NamedNumbers


class EffectPart(base.Document):
    """An effect and the operations of a step that it adds, or would add; null if unknown."""

    name: str
    operations: int | None


class EffectsPart(base.Document):
    """What acts and what was left out; `operations` of a whole step of `method`, the first that steps by a kernel."""

    acting: list[EffectPart]
    left_out: list[EffectPart]
    method: str | None
    operations: int | None


class SimulationResult(base.Document):
    """What was simulated, how each method ended, and every observed quantity."""

    format: Literal["inverse-service/simulation/1"]
    name: str
    system: SimulatedSystem
    initial: StartPoint
    units: dict[str, str]
    bodies: dict[str, list[str]]
    step: float
    steps: int
    record_every: int
    observe: list[str]
    effects: EffectsPart
    methods: list[SimulatedMethod]
    truth: dict[str, Any] | None
    advice: AdvicePart | None
    lyapunov: dict[str, Any] | None = None
    circle_coordinates: list[str] | None
    derived: list[str]
    seconds: NamedNumbers
    notes: list[str]
    provenance: dict[str, Any]


class MeasuredPart(base.Document):
    """A method with its step or its tolerance, and the seconds it took; null where it was not measured."""

    method: str
    step: float | None
    tolerance: float | None
    seconds: float | None


class RunPart(MeasuredPart):
    """One method at one step size, or at one tolerance: its error and what it cost; null where it was not measured."""

    order: int | None
    steps: int | None
    error: float | None
    evaluations: int | None
    median_seconds: float | None
    first_seconds: float | None
    compile_seconds: float | None
    repeats: int
    newton_iterations: int | None
    at_floor: bool
    reason: str


class PrecisionMethod(base.Document):
    """A method, with the order that was measured."""

    label: str
    method: str
    family: str
    order: int | None
    measured_order: float | None


class PricePart(MeasuredPart):
    """What an error costs by one method; null where the method does not reach it. `at_most`: it is better than that at
    its coarsest setting."""

    order: int | None
    ratio: float | None
    evaluations: float | None
    at_most: bool | None
    too_slow: bool


class TargetPart(base.Document):
    """A relative error and what it costs, the cheapest method first."""

    error: float
    rows: list[PricePart]


class LongPart(MeasuredPart):
    """A method over a hundred times the time: errors of the energy and the constraints, and of the shape."""

    energy_error: float | None
    energy_drift: float | None
    constraint_error: float | None
    shape_change: float | None
    reason: str


class WorkPrecisionResult(base.Document):
    """Error against time for every method, at many step sizes."""

    format: Literal["inverse-service/work-precision/1"]
    name: str
    time: float
    scale: float
    error: str
    truth: dict[str, Any]
    targets: list[TargetPart]
    sentences: list[str]
    advice: AdvicePart | None
    methods: list[PrecisionMethod]
    runs: list[RunPart]
    long: list[LongPart]
    machine: dict[str, Any]
    provenance: dict[str, Any]
