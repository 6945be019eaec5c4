"""docs/fields.md from the OpenAPI description, docs/reference.md from docstrings: `make reference`."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any

from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs.blocks import ROOT

DOCS = ROOT / "docs"
# What is written by hand stands before and after these marks.
BEGIN, END = "<!-- fields -->\n\n", "<!-- end of fields -->\n"
MODULES = (
    "inverse_service",
    "inverse_service.sympy",
    "inverse_service.sympy.result_objects",
    "inverse_service.client",
    "inverse_service.catalogue",
    "inverse_service.errors",
)
# What stands in a module for others of the package and not for its users.
INNER = frozenset(("result_of", "find", "names_for", "answers_to_many", "row_of", "table_of"))


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


def reference() -> str:
    """Every public function and class of `MODULES` with its signature and docstring."""
    parts = [
        "# The Python interface\n\n"
        "Made from the docstrings by `make reference`. Examples are in the [guide](guide.md) and in "
        "[sympy.md](sympy.md); the\nfields of documents and results in [fields.md](fields.md).\n"
    ]
    for name in MODULES:
        module = importlib.import_module(name)
        parts.append(f"## {name}\n\n{_text(module)}\n")
        parts += [_entry(word, getattr(module, word)) for word in _public(module)]
    return "\n".join(parts)


def _public(module: Any) -> list[str]:
    """The names a user may take from the module: its __all__, else what is defined there."""
    own = getattr(module, "__all__", None) or [
        name for name, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__
    ]
    elsewhere = "inverse_service.sympy.result_objects"
    documented = elsewhere if module.__name__ != elsewhere else ""
    values = {name: getattr(module, name) for name in own if name[0] != "_" and name not in INNER}
    return sorted(
        name
        for name, value in values.items()
        if (inspect.isfunction(value) or inspect.isclass(value)) and value.__module__ != documented
    )


def _entry(name: str, value: Any) -> str:
    if not inspect.isclass(value):
        return f"### {name}\n\n`{name}{_signature(value)}`\n\n{_text(value)}\n"
    members = []
    for word, member in vars(value).items():
        function = getattr(member, "func", getattr(member, "fget", member))
        if word[0] == "_" or not inspect.isfunction(function):
            continue
        called = _signature(member) if inspect.isfunction(member) else ""
        members.append(f"- `{word}{called}`: {_plain(inspect.getdoc(function) or '')}")
    made = _signature(value) if issubclass(value, Exception) is False else ""
    return "\n".join([f"### {name}\n\n`{name}{made}`\n\n{_text(value)}\n", *members, ""])


def _signature(value: Any) -> str:
    """The arguments without their types, which are in the source."""
    signature = inspect.signature(value)
    plain = [
        parameter.replace(annotation=parameter.empty)
        for parameter in signature.parameters.values()
        if parameter.name != "self"
    ]
    return str(signature.replace(parameters=plain, return_annotation=signature.empty))


def _text(value: Any) -> str:
    """The docstring; indented lines are code already."""
    return (inspect.getdoc(value) or "").replace("*", "\\*") if not inspect.ismodule(value) else _plain_module(value)


def _plain_module(module: Any) -> str:
    text = inspect.getdoc(module) or ""
    paragraphs = [part for part in text.split("\n\n") if not part.startswith("    ")]
    return "\n\n".join(paragraphs)


def fields_page(description: dict[str, Any]) -> str:
    """docs/fields.md with its tables made again."""
    page = (DOCS / "fields.md").read_text()
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + fields(description) + "\n" + END + rest.partition(END)[2]


def main() -> None:
    """Write both pages."""
    (DOCS / "fields.md").write_text(fields_page(create_application(read_settings()).openapi()))
    (DOCS / "reference.md").write_text(reference())


if __name__ == "__main__":
    main()
