"""Whether the system of a certificate is that of a document as a user gave it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from inverse_service.certificate.checker import CheckResult
from inverse_service.deadline import now
from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Symbol, Velocity, substitute, subtract
from inverse_service.mechanics.agreement import Canonical, GivenText, equations_agree, motion_agrees
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting
from inverse_service.service.documents.preparing import is_motion, is_nonholonomic, prepared

if TYPE_CHECKING:
    from api_schemas.system import SystemDocument
    from inverse_service.mechanics.constrained_motion import ConstrainedMotion, NonholonomicSystem


def compared_with_document(document: Any, canonical: Canonical, time_limit: float = 60.0) -> CheckResult:
    """The checker's kind of verdict on: these right sides are what the document asks about. Never raises.

    Names have to be the same, coordinates in the same order; then `mechanics.agreement` decides. Of a
    Lagrangian with constraints the system may be any associated one: it is compared where the constraints hold.
    """
    question = repr((document, canonical))
    if question in _COMPARED:
        return _COMPARED[question]
    found = _compared(document, canonical, now() + time_limit)
    if found.verdict == "valid":
        _COMPARED[question] = found
        if len(_COMPARED) > MOST_KEPT:
            del _COMPARED[next(iter(_COMPARED))]
    return found


# The same system leaves with each part of a growing result; what was found to agree is not compared again.
MOST_KEPT = 16
_COMPARED: dict[str, CheckResult] = {}


def _compared(document: Any, canonical: Canonical, end: float) -> CheckResult:
    try:
        document = prepared(document).document
        if is_nonholonomic(document):
            return _compared_motion(document, canonical, end)
        schema = accepting.to_schema(document)
        given = accepting.to_given(schema)
    except InputError as error:
        return CheckResult("invalid", (f"The document as given cannot be read: {error}",))
    names, texts = given.names, _texts(schema, given.names)
    texts = texts if len(texts) == len(given.residuals) else []
    limit = end - now()
    return _named(names, canonical) or equations_agree(given.residuals, names.coordinates, canonical, limit, texts)


def _compared_motion(document: Any, canonical: Canonical, end: float) -> CheckResult:
    # Imported where it is needed: it takes 0.05 s, which a single call for another system notices.
    motion = _nonholonomic(document)
    functions = dict(motion.functions)
    names = Names(motion.coordinates, motion.parameters, functions)
    return _named(names, canonical) or motion_agrees(motion, canonical, end - now())


def compared_claim(document: Any, certificate: Mapping[str, Any], time_limit: float = 60.0) -> CheckResult:
    """Whether a certificate about a motion on constraints is about that of the document. Never raises.

    The constraints hold with its velocities, and its accelerations are the motion, as of an associated system.
    """
    from inverse_service.constrained.hamiltonise import vanish
    from inverse_service.constrained.lagrangian import first_system
    from inverse_service.service.documents.reduced_documents import look_motion, read

    try:
        document = prepared(document).document
        claimed = _claimed(_with_velocities(certificate["system"], document))
        if is_motion(document):
            given = read(look_motion(document))
            pairs = zip(given.free_accelerations, claimed.free_accelerations, strict=True)
            trees, differ = [subtract(*pair) for pair in pairs], given.free != claimed.free
            constraints = [v - w for v, w in given.on_constraints.items()]
        else:
            made = _nonholonomic(document)
            constraints, trees, differ = (
                list(made.constraints),
                [],
                sorted(made.coordinates) != sorted(claimed.coordinates)
                or len(made.constraints) != len(claimed.dependent),  # a smaller D is another motion
            )
        trees += [substitute(tree, claimed.on_constraints) for tree in constraints]
    except (InputError, KeyError, ValueError):
        return CheckResult("invalid", ("The motion of a certificate cannot be compared with the document as given.",))
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, claimed.coordinates), *map(Velocity, claimed.free)]
    found = None if differ else vanish(trees, [*variables, *map(Symbol, claimed.parameters)])
    if differ or not found:
        sentence = "The motion of a certificate is not that of the document as given."
        return CheckResult("incomplete" if found is None and not differ else "invalid", (sentence,))
    if is_motion(document):
        return CheckResult("valid", ("The motion is that of the document as given.",))
    whole = first_system(claimed)
    texts = {name: to_text(f) for name, f in zip(whole.coordinates, whole.accelerations, strict=True)}
    system = {key: certificate["system"].get(key) for key in ("parameters", "functions")}
    # A certificate names the free coordinates first.
    system |= {"coordinates": list(made.coordinates), "equations": texts}
    return compared_with_document(document, Canonical(system, dict(certificate)), time_limit)


def _with_velocities(system: Mapping[str, Any], document: Any) -> Mapping[str, Any]:
    """The system of a certificate; one about the free coordinates alone gets the others with their velocities."""
    if system.get("velocities") is not None:
        return system
    from inverse_service.constrained.nonholonomic_study import motion_report
    from inverse_service.service.documents.reduced_documents import look_motion, read

    motion = read(look_motion(document)) if is_motion(document) else motion_report(_nonholonomic(document)).motion
    rates = zip(motion.dependent, motion.dependent_velocities, strict=True)
    velocities = {name: to_text(rate) for name, rate in rates if name not in system["coordinates"]}
    coordinates = [*system["coordinates"], *velocities]
    return {**system, "coordinates": coordinates, "velocities": velocities}


def _claimed(system: Mapping[str, Any]) -> ConstrainedMotion:
    from inverse_service.mechanics.constrained_motion import read_motion

    constraints = [f"{name}' = {w}" for name, w in system["velocities"].items()]
    return read_motion(
        system["coordinates"], system["equations"], constraints, system["parameters"], system["functions"]
    )


def _nonholonomic(document: Any) -> NonholonomicSystem:
    from inverse_service.service.documents.translate_nonholonomic import to_nonholonomic, to_nonholonomic_schema

    return to_nonholonomic(to_nonholonomic_schema(document))


def _texts(schema: SystemDocument, names: Names) -> list[GivenText | None]:
    """The equations as texts for a second reader, in the order of their trees; None where that is not plain."""
    if schema.where:  # the second reader knows no formulas for names
        return []
    valued = schema.parameters.items() if isinstance(schema.parameters, Mapping) else ()
    values = {name: str(value) for name, value in valued if value is not None}
    if isinstance(schema.equations, Mapping):
        found = {key: GivenText(f"{key}''", str(text), values) for key, text in schema.equations.items()}
        return [found.get(name) for name in names.coordinates]
    texts = schema.equations.split(";") if isinstance(schema.equations, str) else schema.equations
    sides = [str(text).split("=") for text in texts if str(text).strip()]
    return [GivenText(pair[0], pair[1], values) if len(pair) == 2 else None for pair in sides]


def _named(names: Names, canonical: Canonical) -> CheckResult | None:
    """What differs in the declared names, None where nothing does."""
    system = canonical.system if isinstance(canonical.system, Mapping) else {}
    pairs = {
        "coordinates": (list(names.coordinates), system.get("coordinates")),
        "parameters": (sorted(names.parameters), _sorted(system.get("parameters") or [])),
        "functions": ({key: list(of) for key, of in names.functions.items()}, system.get("functions") or {}),
    }
    for what, (given, found) in pairs.items():
        if given != found:
            return CheckResult("invalid", (f"The {what} are not those of the document as given.",))
    return None


def _sorted(names: Any) -> Any:
    return sorted(names) if isinstance(names, list) and all(isinstance(name, str) for name in names) else names
