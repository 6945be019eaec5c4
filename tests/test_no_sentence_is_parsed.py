"""Programs compare values, not the sentences that people read."""

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.test_layering import nodes, parsed

ROOT = Path(__file__).parent.parent / "inverse_service"
WORDS = 3  # so many words are a sentence
# Codes of the reader that are words as well.
OF_READING = (
    "reading/tokens.py: wanted == END",
    "reading/latex.py: reason.problem == 'is a word'",
)
PARSING = {
    "startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "split",
    "find", "index", "count", "compile", "match", "search", "fullmatch",
}  # fmt: skip


def is_sentence(node: ast.AST) -> bool:
    """A text of some words, also one that is put together."""
    match node:
        case ast.Constant(str(text)):
            return sum(word.isalpha() for word in text.replace("'", "").split()) >= WORDS
        case ast.JoinedStr(values):
            return any(map(is_sentence, values))
        case ast.BinOp(left, ast.Add(), right):
            return is_sentence(left) or is_sentence(right)
        case ast.Tuple(entries) | ast.List(entries) | ast.Set(entries):
            return any(map(is_sentence, entries))
        case ast.Call(ast.Name("frozenset" | "Open"), arguments) | ast.Call(
            ast.Attribute(attr="Open"), arguments
        ):
            return any(map(is_sentence, arguments))
    return False


def keys(table: Mapping[str, object]) -> Iterator[str]:
    """The keys of a table and of the tables in it, which are no sentences."""
    for key, value in table.items():
        yield key
        if isinstance(value, dict):
            yield from keys(value)


def constants(tree: ast.Module) -> Iterator[str]:
    """The names at the head of a module that are sentences, or hold some."""
    for node in tree.body:
        match node:
            case ast.Assign([ast.Name(name)], value) | ast.AnnAssign(
                ast.Name(name), _, ast.expr() as value
            ):
                if is_sentence(value):
                    yield name


def faults(sources: Mapping[str, str]) -> list[str]:
    """Where a sentence is compared, or looked for in a text."""
    trees = {name: parsed(source) for name, source in sources.items()}
    own = {name: {*constants(tree)} for name, tree in trees.items()}
    known = {Path(name).stem: names for name, names in own.items()}
    found = []
    for name in trees:

        def says(node: ast.AST, here: frozenset[str] = frozenset(own[name])) -> bool:
            match node:
                case ast.Name(word):
                    return word in here
                case ast.Attribute(inner, "words"):
                    return says(inner, here)
                case ast.Attribute(ast.Name(module), word):
                    return word in known.get(module, ())
                case ast.Tuple(entries) | ast.List(entries) | ast.Set(entries):
                    return any(map(says, entries))
            return is_sentence(node)

        for node in nodes(sources[name]):
            match node:
                case ast.Compare(left, operators, others) if not all(
                    isinstance(one, ast.Is | ast.IsNot) for one in operators
                ):
                    texts = [left, *others]
                case ast.Call(ast.Attribute(text, word), arguments) if word in PARSING:
                    texts = [text, *arguments]
                case _:
                    continue
            if any(map(says, texts)):
                found.append(f"{name}:{node.lineno}: {ast.unparse(node)}")
    return found


def test_no_sentence_of_ours_is_compared_or_parsed() -> None:
    sources = {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in ROOT.rglob("*.py")
    }
    words = tomllib.loads((ROOT / "reading" / "words.toml").read_text(encoding="utf-8"))
    found = [one for one in faults(sources) if not any(f"== '{key}'" in one for key in keys(words))]
    assert [one for one in found if re.sub(r":\d+:", ":", one) not in OF_READING] == []


@pytest.mark.parametrize(
    "source",
    [
        'def f(one): return one.reason.startswith("the time limit came before")',
        'OVER = "the time was over"\ndef f(one): return OVER in one.reason',
        'OVER = Open(TIME, "the time was over")\ndef f(one): return one.reason == OVER.words',
        'def f(one): return one["reason"] in ("no time was left", other)',
        'import re\nPATTERN = re.compile(r"order (.*) of prolongation")',
        "from a import reasons\ndef f(one): return one.reason == reasons.NO_TIME",
    ],
)
def test_a_comparison_with_a_sentence_is_found(source: str) -> None:
    assert faults({"a/b": source, "a/reasons": 'NO_TIME = "the time was over"'}) != []


def test_a_comparison_of_values_is_none() -> None:
    source = 'OVER = Open(TIME, "the time was over")\ndef f(one): return one.open is OVER or one.reason == "time"'
    assert faults({"a": source}) == []
