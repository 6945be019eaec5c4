"""What runs say to people, by the keys of `sentences.toml`."""

import tomllib
from pathlib import Path

SENTENCES: dict[str, str] = tomllib.loads(
    (Path(__file__).parent / "sentences.toml").read_text(encoding="utf-8")
)


def say(key: str, *words: object) -> str:
    """The sentence, or part of one, with its numbers and names."""
    return SENTENCES[key].format(*words)
