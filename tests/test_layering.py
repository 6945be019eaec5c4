"""The layers of docs/explanation/architecture.md are enforced: imports point down only."""

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLOORS = {
    "errors": 1, "bounds": 1, "deadline": 1, "garbage": 1, "settings": 1, "catalogue": 1, "certificate": 1,
    "expressions": 2, "integrators": 2, "kernels": 3, "reading": 3, "field": 4,
    "linear_pde": 5, "mechanics": 5, "statements": 3, "decision": 7, "search": 8, "explanation": 9, "solving": 10,
    "constrained": 11, "fitting": 11, "simulation": 7, "service": 12, "sympy": 13,
    "client": 13, "data": 14, "web": 15, "cli": 16, "__main__": 17,
}  # fmt: skip
ALLOWED_ON_FLOOR_ONE = {"settings": {"errors"}, "catalogue": {"errors"}, "certificate": {"errors"}}
KNOW_SCHEMAS = {"client", "service", "web", "cli"}
MODULES = sorted(path.relative_to(ROOT) for path in (ROOT / "inverse_service").rglob("*.py"))
SCHEMAS = sorted(path.relative_to(ROOT) for path in (ROOT / "api_schemas").rglob("*.py"))


@cache
def parsed(source: str) -> ast.Module:
    return ast.parse(source)


@cache
def nodes(source: str) -> tuple[ast.AST, ...]:
    """All nodes of a file but Load, Store and Del, as `ast.walk` lists them in twice the time."""
    found: list[ast.AST] = [parsed(source)]
    for node in found:
        for part in vars(node).values():
            if isinstance(part, list):
                found += [one for one in part if isinstance(one, ast.AST)]
            elif isinstance(part, ast.AST) and not isinstance(part, ast.expr_context):
                found.append(part)
    return tuple(found)


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """All statements, which are a tenth of the nodes."""
    left: list[ast.AST] = [tree]
    while left:
        node = left.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            part = getattr(node, name, None)
            left += part if isinstance(part, list) else []


@cache
def imported(source: str, package: str) -> list[str]:
    """Full names of all modules that a source imports, lazily or not."""
    found: list[str] = []
    for node in statements(parsed(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = (
                package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            )
            module = ".".join([*base, *([node.module] if node.module else [])])
            found += [f"{module}.{alias.name}" for alias in node.names]
    return found


def room(module: str) -> str | None:
    """The package or module directly below inverse_service, or None for other modules and for the
    root itself.
    """
    parts = module.split(".")
    return (
        parts[1]
        if parts[0] == "inverse_service" and len(parts) > 1 and parts[1] in FLOORS
        else None
    )


def faults(path: Path, source: str) -> list[str]:
    """Imports of a module that do not point down."""
    parts = path.with_suffix("").parts
    own = parts[1] if len(parts) > 1 else ""
    found = []
    for module in imported(source, ".".join(parts[:-1])):
        target = room(module)
        if module.split(".")[0] == "api_schemas" and own not in KNOW_SCHEMAS:
            found.append(f"{path} imports {module}")
        if target is None or target == own or own not in FLOORS:
            continue
        down = FLOORS[target] < FLOORS[own] or target in ALLOWED_ON_FLOOR_ONE.get(own, set())
        if not down:
            found.append(f"{path} imports {module}")
    return found


def test_imports_point_down_only() -> None:
    assert [
        fault
        for path in MODULES
        for fault in faults(path, (ROOT / path).read_text(encoding="utf-8"))
    ] == []


def without_types(source: str) -> str:
    """The source without what only a type checker reads."""
    body = [
        node
        for node in parsed(source).body
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    ]
    return ast.unparse(ast.Module(body, []))


def imports_of_each(sources: Mapping[Path, str]) -> dict[str, set[str]]:
    """For each module those of the others that it imports, at its head, in a function, or for its
    types.

    Without the root, a facade that imports what is called: what is below may import it lazily.
    Without the types of the checker: a `Question` is read by rings that it makes itself.
    """
    names = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in sources
    }
    del names["inverse_service"]
    found: dict[str, set[str]] = {}
    for name, path in names.items():
        source = (
            without_types(sources[path])
            if path.is_relative_to("inverse_service/certificate")
            else sources[path]
        )
        each = imported(source, ".".join(path.parts[:-1]))
        found[name] = names.keys() & {
            one if one in names else one.rpartition(".")[0] for one in each
        } - {name}
    return found


def test_no_file_imports_another_in_a_circle() -> None:
    """`prepare` raises CycleError."""
    sources = {path: (ROOT / path).read_text(encoding="utf-8") for path in (*MODULES, *SCHEMAS)}
    TopologicalSorter(imports_of_each(sources)).prepare()


@pytest.mark.parametrize(
    "back",
    [
        "from inverse_service.web import engine",
        "def f():\n    from inverse_service.web.engine import Engine",
        "if TYPE_CHECKING:\n    from .engine import Engine",
        "from inverse_service.web.other import f",
    ],
)
def test_a_circle_is_found(back: str) -> None:
    sources = {
        "__init__": "",
        "web/asking": back,
        "web/engine": "from . import asking",
        "web/other": "from .engine import Engine",
    }
    graph = imports_of_each(
        {Path(f"inverse_service/{name}.py"): source for name, source in sources.items()}
    )
    with pytest.raises(CycleError):
        TopologicalSorter(graph).prepare()


def test_schemas_know_nothing_of_the_engine() -> None:
    names = [
        name
        for path in SCHEMAS
        for name in imported((ROOT / path).read_text(encoding="utf-8"), "api_schemas")
    ]
    assert [name for name in names if name.startswith("inverse_service")] == []


def test_checker_imports_nothing_of_the_project() -> None:
    """It imports only its own folder, relatively, so a copy runs anywhere."""
    for path in sorted((ROOT / "inverse_service/certificate").glob("*.py")):
        source = path.read_text(encoding="utf-8")
        found = [
            name
            for name in imported(source, "certificate")
            if room(name) or "inverse_service" in name
        ]
        assert found == []


DOOR = "inverse_service.certificate.checker"


def through_another_door(source: str, package: str) -> list[str]:
    """What a source imports of the checker, in functions and for its types too, but for its door
    as a module: so that its names are used with the word `checker` before them.
    """
    found = imported(source, package)
    return [name for name in found if room(name) == "certificate" and name != DOOR]


def test_only_the_door_of_the_checker_is_imported() -> None:
    """What the solver says of a formula or of a set is its own: the checker only judges it."""
    found = {
        str(path): names
        for path in MODULES
        if not path.is_relative_to("inverse_service/certificate")
        and (
            names := through_another_door(
                (ROOT / path).read_text(encoding="utf-8"), ".".join(path.parts[:-1])
            )
        )
    }
    assert found == {}


@pytest.mark.parametrize(
    "source",
    [
        "from inverse_service.certificate import cell",
        "def f():\n    from inverse_service.certificate.cell import Knowledge",
        "if TYPE_CHECKING:\n    from ..certificate.question import Question",
        "import inverse_service.certificate.numbers",
        "from inverse_service import certificate",
        "from inverse_service.certificate.checker import Question",
    ],
)
def test_another_door_of_the_checker_is_found(source: str) -> None:
    assert through_another_door(source, "inverse_service.field") != []


def test_what_lies_below_the_decision_does_not_know_the_checker() -> None:
    """Trees, fields, mechanics and the search compute without asking it."""
    below = ("expressions", "kernels", "reading", "field", "linear_pde", "mechanics", "search")
    found = [
        str(path)
        for path in MODULES
        if path.parts[1] in below
        and DOOR in imported((ROOT / path).read_text(encoding="utf-8"), ".".join(path.parts[:-1]))
    ]
    assert found == []


def test_every_package_has_a_floor() -> None:
    rooms = {path.parts[1].removesuffix(".py") for path in MODULES} - {"__init__"}
    assert rooms <= set(FLOORS)


@pytest.mark.parametrize(
    "source",
    [
        "from inverse_service.mechanics.conditions import conditions",
        "import inverse_service.field.modular",
        "def f():\n    from inverse_service.web import routes",
        "from ..mechanics import conditions",
        "from inverse_service import service",
        "from api_schemas.result import ResultDocument",
    ],
)
def test_an_import_that_points_up_is_found(source: str) -> None:
    assert faults(Path("inverse_service/expressions/text.py"), source)


def test_what_a_worker_loads_first_is_there() -> None:
    """A list names these modules, so a moved module can be missed; without them a service never
    becomes ready.
    """
    from inverse_service.service.jobs.tasks import ENGINE

    missing = [
        name
        for name in ENGINE
        if not (ROOT / "inverse_service" / f"{name.replace('.', '/')}.py").exists()
    ]
    assert [
        name for name in missing if not (ROOT / "inverse_service" / name.replace(".", "/")).is_dir()
    ] == []
