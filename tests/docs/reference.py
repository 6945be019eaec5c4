"""docs/fields.md from the OpenAPI description: `make reference`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs.blocks import ROOT

DOCS = ROOT / "docs"
# What is written by hand stands before and after these marks.
BEGIN, END = "<!-- fields -->\n\n", "<!-- end of fields -->\n"


def fields(description: dict[str, Any]) -> str:
    """A table of its properties for every model of an answer, the results first."""
    schemas = description["components"]["schemas"]
    answers = [
        reference
        for calls in sorted(description["paths"].items(), key=lambda item: item[0] != "/v1/solve")
        for call in calls[1].values()
        for answer in call["responses"].values()
        for reference in _references(answer)
    ]
    order = dict.fromkeys(["ResultDocument", "NonholonomicResult", *answers])
    while more := [name for model in order for name in _references(schemas[model]) if name not in order]:
        order |= dict.fromkeys(more)
    return "\n".join(_table(name, schemas[name], schemas["ResultDocument"]) for name in order)


def _references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"].rsplit("/", 1)[-1]
        for part in schema.values():
            yield from _references(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from _references(part)


def _table(name: str, schema: dict[str, Any], result: dict[str, Any]) -> str:
    properties = schema["properties"]
    rows = []
    if name != "ResultDocument" and properties.keys() > result["properties"].keys():
        properties = {key: part for key, part in properties.items() if key not in result["properties"]}
        rows = ["| … | the fields of ResultDocument | |"]
    rows += [f"| `{key}` | {_cell(part.get('description', ''))} | {kind(part)} |" for key, part in properties.items()]
    head = "| field | what it is | type |\n| --- | --- | --- |"
    return "\n".join([f"## {name}", "", _plain(schema.get("description", "")), "", head, *rows, ""])


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
        return f"object of {kind(values)} by name" if isinstance(values, dict) and values else "object"
    plain = {"string": "text", "null": "null", "boolean": "true or false", "integer": "integer", "number": "number"}
    return plain.get(schema.get("type", ""), "anything")


def fields_page(description: dict[str, Any]) -> str:
    """docs/fields.md with its tables made again."""
    page = (DOCS / "fields.md").read_text()
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + fields(description) + "\n" + END + rest.partition(END)[2]


def main() -> None:
    """Write the page."""
    (DOCS / "fields.md").write_text(fields_page(create_application(read_settings()).openapi()))


if __name__ == "__main__":
    main()
