"""The words of the pages from words.toml: what is said, what can be chosen, which drawing belongs to what."""

import tomllib
from pathlib import Path
from typing import Any

TABLES: dict[str, Any] = tomllib.loads((Path(__file__).parent / "words.toml").read_text(encoding="utf-8"))
