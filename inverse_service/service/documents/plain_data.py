"""Bytes to plain data: JSON, YAML and TOML, read strictly and exactly.

Stricter than the libraries: a key given twice, NaN and the infinities, lone surrogates, numbers
of thousands of digits, YAML anchors and deep nesting are refused. Decimal numbers stay exact.
"""

import functools
import json
import re
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from typing import Any, Literal, NoReturn

from inverse_service import errors

MAX_DEPTH = 64
_WRITER = json.JSONEncoder(allow_nan=False, separators=(",", ":"))
_SORTING_WRITER = json.JSONEncoder(allow_nan=False, separators=(",", ":"), sort_keys=True)
MAX_NUMBER_CHARACTERS = 400
# Possessive: the match never backtracks, so that a string of megabytes takes no extra memory.
_JSON_STRING = re.compile(rb'"(?:[^"\\]++|\\.)*+(?:"|\Z)', re.DOTALL)
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_ESCAPED_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
# Keys of so many parts are refused before tomllib sees them, whose time and memory grow with the
# square.
_DOTTED_KEY = re.compile(
    rf"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}"""
)


def read_json(data: bytes | str) -> Any:
    """The value of a JSON text; raises InputError with line and column, or with the pointer."""
    text = decode(data)
    if not text.strip():
        raise errors.InputError(
            "The document is empty; write a JSON object with coordinates and equations."
        )
    _refuse_deep_json(text)
    try:
        value = _reader().decode(text)
    except json.JSONDecodeError as error:
        what = _first_lower(error.msg.removesuffix(" at"))
        raise errors.InputError(
            f"The document is not JSON: {what} at line {error.lineno}, column {error.colno}."
        ) from None
    except RecursionError:
        raise _too_deep() from None
    if _ESCAPED_SURROGATE.search(text):
        refuse_surrogates(value)
    return value


@functools.cache
def _reader() -> json.JSONDecoder:
    return json.JSONDecoder(
        object_pairs_hook=_object,
        parse_constant=_refuse_constant,
        parse_float=_decimal,
        parse_int=_integer,
    )


def write_json(value: Any, keys: Literal["as given", "sorted"] = "as given") -> str:
    """Plain data as JSON in ASCII; a Decimal is written as the number it was read from."""
    try:
        return (_SORTING_WRITER if keys == "sorted" else _WRITER).encode(value)
    except TypeError:  # there is one
        return _with_decimals(value, keys)


def _with_decimals(value: Any, keys: Literal["as given", "sorted"]) -> str:
    if isinstance(value, Mapping):
        names = sorted(value) if keys == "sorted" else list(value)
        return (
            "{"
            + ",".join(f"{json.dumps(name)}:{write_json(value[name], keys)}" for name in names)
            + "}"
        )
    if isinstance(value, list | tuple):
        return "[" + ",".join(write_json(part, keys) for part in value) + "]"
    return str(value) if isinstance(value, Decimal) else _WRITER.encode(value)


def read_yaml(data: bytes | str) -> Any:
    """The value of a YAML text; scalars other than true, false and null stay text, so 0.1 is
    exact.
    """
    import yaml

    try:
        value = yaml.load(decode(data), Loader=_plain_loader())
    except yaml.YAMLError as error:
        raise errors.InputError(
            f"The document is not YAML that can be read here: {_yaml_reason(error)}."
        ) from None
    except RecursionError:
        raise _too_deep() from None
    refuse_surrogates(value)
    return value


def _loader_by_libyaml() -> Any:
    """PyYAML's safe loader with events from libyaml, in a quarter of the time: a megabyte takes 3 s.

    Nodes are composed in Python: yaml.CSafeLoader, which composes them itself, takes aliases.
    """
    from yaml import composer, constructor, resolver
    from yaml._yaml import CParser

    class Loader(composer.Composer, CParser, constructor.SafeConstructor, resolver.Resolver):
        def __init__(self, stream: Any) -> None:
            CParser.__init__(self, stream)
            composer.Composer.__init__(self)
            constructor.SafeConstructor.__init__(self)
            resolver.Resolver.__init__(self)

    return Loader


@functools.cache
def _plain_loader() -> Any:
    """A loader that reads every scalar but true, false and null as text, and takes no tags, anchors
    or keys twice.

    YAML's own numbers would turn 0.1 into a binary fraction and 1:30 into 90. A few lines of
    anchors stand for billions of values. It is made at the first use, as few documents are YAML.
    """
    import yaml

    base: Any = _loader_by_libyaml() if yaml.__with_libyaml__ else yaml.SafeLoader

    class PlainLoader(base):  # type: ignore[misc]
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                event = self.peek_event()
                raise yaml.composer.ComposerError(
                    None, None, "aliases (*name) are not accepted", event.start_mark
                )
            return super().compose_node(parent, index)

    def mapping(loader: Any, node: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(
                    None, None, "a key must be text", key_node.start_mark
                )
            if key in found:
                raise yaml.constructor.ConstructorError(
                    None, None, "a key is given twice", key_node.start_mark
                )
            found[key] = loader.construct_object(value_node, deep=True)
        return found

    PlainLoader.yaml_implicit_resolvers = {}
    PlainLoader.add_constructor("tag:yaml.org,2002:map", mapping)
    bools, nothing = (
        re.compile(r"^(?:true|True|TRUE|false|False|FALSE)$"),
        re.compile(r"^(?:~|null|Null|NULL|)$"),
    )
    PlainLoader.add_implicit_resolver("tag:yaml.org,2002:bool", bools, list("tTfF"))
    PlainLoader.add_implicit_resolver("tag:yaml.org,2002:null", nothing, ["~", "n", "N", ""])
    return PlainLoader


def read_toml(data: bytes | str) -> Any:
    """The value of a TOML text; raises InputError with the place."""
    import tomllib

    text = decode(data)
    if _DOTTED_KEY.search(text):
        raise _too_deep()
    try:
        value = tomllib.loads(text, parse_float=_decimal)
    except tomllib.TOMLDecodeError as error:
        raise errors.InputError(
            f"The document is not TOML: {_first_lower(str(error))[:200]}."
        ) from None
    except RecursionError:
        raise _too_deep() from None
    except ValueError as error:
        if isinstance(error, errors.InputError):
            raise
        raise errors.InputError(
            "The document contains a number with too many digits; write it as a formula."
        ) from None
    refuse_surrogates(value)
    return value


def read_document(data: bytes | str, file_name: str) -> Any:
    """By the ending of the name: .yaml and .yml, .toml; else JSON, or equations where it is no
    object and has an =.
    """
    ending = file_name.lower().rpartition(".")[2]
    if ending in ("yaml", "yml"):
        return read_yaml(data)
    if ending == "toml":
        return read_toml(data)
    text = decode(data)
    is_formula = "=" in text and ('"' not in text or text.lstrip()[:1] not in ("{", "[", '"'))
    return {"equations": text} if is_formula else read_json(text)


def decode(data: bytes | str) -> str:
    """UTF-8 text, a byte order mark dropped."""
    if isinstance(data, str):
        return data
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise errors.InputError(
            f"The document is not UTF-8 text: byte {error.start + 1} cannot be read."
        ) from None


def refuse_surrogates(value: Any) -> None:
    """Raises InputError where a text, key or value, holds half of a surrogate pair, or where
    nesting is too deep.
    """
    stack: list[tuple[Any, str, int]] = [(value, "", 0)]
    while stack:
        node, pointer, depth = stack.pop()
        if (
            isinstance(node, str)
            and not node.isascii()
            and any("\ud800" <= c <= "\udfff" for c in node)
        ):
            raise errors.InputError(
                "A text contains half of a surrogate pair; write the whole character.", pointer
            )
        if depth > MAX_DEPTH:
            raise _too_deep()
        stack.extend((part, place, depth + 1) for part, place in _parts(node, pointer))


def escape(key: object) -> str:
    """A key as one step of an RFC 6901 pointer, shortened, safe to print."""
    text = str(key).replace("~", "~0").replace("/", "~1")
    printable = "".join(c if c.isprintable() else "?" for c in text[:80])
    return printable if len(text) <= 80 else printable + "..."


def _parts(node: Any, pointer: str) -> Iterable[tuple[Any, str]]:
    if isinstance(node, Mapping):
        for key, part in node.items():
            yield key, pointer
            yield part, f"{pointer}/{escape(key)}"
    elif isinstance(node, list):
        for k, part in enumerate(node):
            yield part, f"{pointer}/{k}"


def _refuse_deep_json(text: str) -> None:
    """One pass over the text, before the reader takes memory for what it holds."""
    depth = 0
    for bracket in _JSON_STRING.sub(b"", text.encode("utf-8", "surrogatepass")).translate(
        None, _NO_BRACKETS
    ):
        depth += 1 if bracket in b"[{" else -1
        if depth > MAX_DEPTH:
            raise _too_deep()


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise errors.InputError(
                f"The key '{escape(key)}' is given twice in one object; keep one of them."
            )
        found[key] = value
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise errors.InputError(f"{name} is not a number of JSON; write a finite number or a formula.")


def _decimal(text: str) -> Decimal:
    if len(text) > MAX_NUMBER_CHARACTERS:
        raise errors.LimitError(
            f"A number has more than {MAX_NUMBER_CHARACTERS} characters; write it as a formula."
        )
    try:
        value = Decimal(text)
    except InvalidOperation:  # an exponent of more digits than Decimal holds
        value = Decimal("inf")
    if not value.is_finite() or abs(value.adjusted()) > 300:
        raise errors.LimitError(
            "A number is beyond 10^300 or not finite; write it as a formula with powers."
        )
    return value


def _integer(text: str) -> int:
    if len(text) > MAX_NUMBER_CHARACTERS:
        raise errors.LimitError(
            f"A number has more than {MAX_NUMBER_CHARACTERS} characters; write it as a formula."
        )
    return int(text)


def _too_deep() -> errors.InputError:
    return errors.LimitError(
        f"The document is nested more than {MAX_DEPTH} levels deep; a system needs three."
    )


def _first_lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def _yaml_reason(error: Exception) -> str:
    problem = getattr(error, "problem", None) or "it holds a character that YAML does not allow"
    mark = getattr(error, "problem_mark", None)
    place = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    printable = "".join(c if c.isprintable() else "?" for c in str(problem)[:120])
    return printable + place
