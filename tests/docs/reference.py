"""Write docs/reference/results.md from the OpenAPI description: `make reference`."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs.blocks import ROOT

PAGE = ROOT / "docs" / "reference" / "results.md"
# The text before and after these marks is written by hand.
BEGIN, END = "<!-- fields -->\n\n", "<!-- end of fields -->\n"


# The results of commands and calls; nested objects follow the first result that contains them.
RESULTS = (
    "ResultDocument",
    "ForwardResult",
    "CheckAnswer",
    "SimulationResult",
    "WorkPrecisionResult",
)
HEAD = "| field | what it is | type |\n| --- | --- | --- |"


def fields(description: dict[str, Any]) -> str:
    """Every field once: first those with the same meaning in several objects, then the remaining
    ones by object.
    """
    schemas = description["components"]["schemas"]
    groups: dict[str, list[str]] = {}
    for result in RESULTS:
        before = {name for group in groups.values() for name in group} | set(RESULTS)
        groups[result] = [
            result,
            *(name for name in _within(result, schemas) if name not in before),
        ]
    kinds: dict[tuple[str, str], list[str]] = defaultdict(list)
    for field, of_field in (
        row for group in groups.values() for name in group for row in _fields(schemas[name]).items()
    ):
        kinds[field].append(of_field)
    shared = {field for field, found in kinds.items() if len(found) > 1}
    parts = [
        "## Fields of several objects",
        "",
        HEAD,
        *(_row(each, kinds[each]) for each in kinds if each in shared),
    ]
    for result, group in groups.items():
        parts += ["", f"## {result}", "", HEAD]
        for name in group:
            of_object = _fields(schemas[name])
            also = [f"`{key}`" for key, meaning in of_object if (key, meaning) in shared]
            text = " ".join(
                filter(None, [_cell(schemas[name].get("description", "")) + ".", _also(also)])
            )
            own = [
                _row(field, [of_field])
                for field, of_field in of_object.items()
                if field not in shared
            ]
            parts += [f"| **{name}** | {text} | |", *own]
    return "\n".join([*parts, ""])


def _fields(schema: dict[str, Any]) -> dict[tuple[str, str], str]:
    """The type of each field, by its name and description."""
    return {
        (key, _cell(part.get("description", ""))): kind(part)
        for key, part in schema.get("properties", {}).items()
    }


def _row(field: tuple[str, str], kinds: list[str]) -> str:
    """A field with all its types; an enumeration omits the types that it contains."""
    plain = dict.fromkeys(each.removesuffix(" or null") for each in kinds)
    plain = [each for each in plain if not any(other.startswith(f"{each}, ") for other in plain)]
    null = " or null" if any(each.endswith(" or null") for each in kinds) else ""
    return f"| `{field[0]}` | {field[1]} | {'; '.join(plain)}{null} |"


def _also(names: list[str]) -> str:
    return f"Also {', '.join(names)}." if names else ""


def _within(name: str, schemas: dict[str, Any]) -> Iterator[str]:
    """The nested objects, each once, depth first."""
    found = dict.fromkeys(_references(schemas[name]))
    while more := [
        each for part in found for each in _references(schemas[part]) if each not in found
    ]:
        found |= dict.fromkeys(more)
    yield from found


def _references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"].rsplit("/", 1)[-1]
        for part in schema.values():
            yield from _references(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from _references(part)


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


def _cell(text: str) -> str:
    plain = _plain(text)
    return (plain if plain.endswith("...") else plain.removesuffix(".")).replace("|", "\\|")


def kind(schema: dict[str, Any]) -> str:
    """The type in words."""
    if "$ref" in schema:
        return str(schema["$ref"].rsplit("/", 1)[-1])
    either = schema.get("anyOf") or schema.get("oneOf")
    if isinstance(schema.get("type"), list):
        either = [{**schema, "type": each} for each in schema["type"]]
    if either:
        return " or ".join(dict.fromkeys(map(kind, either)))
    if values := schema.get("enum", [schema["const"]] if "const" in schema else []):
        return ", ".join(f"`{value}`" for value in values)
    if schema.get("type") == "array":
        return f"list of {kind(schema.get('items', {}))}"
    if schema.get("type") == "object":
        values = schema.get("additionalProperties")
        return (
            f"object of {kind(values)} by name" if isinstance(values, dict) and values else "object"
        )
    plain = {
        "string": "text",
        "null": "null",
        "boolean": "true or false",
        "integer": "integer",
        "number": "number",
    }
    return plain.get(schema.get("type", ""), "anything")


def fields_page(description: dict[str, Any]) -> str:
    """docs/reference/results.md with new tables."""
    page = (PAGE).read_text()
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + fields(description) + "\n" + END + rest.partition(END)[2]


def main() -> None:
    """Write the page."""
    (PAGE).write_text(fields_page(create_application(read_settings()).openapi()))


if __name__ == "__main__":
    main()
