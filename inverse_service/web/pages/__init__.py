"""Pages written by the server; they work without scripts, and a small script makes them live.

What they say, what can be chosen, and which drawing belongs to what is in words.toml.
"""

import tomllib
from pathlib import Path
from typing import Any

# What workers have loaded besides the engine.
TASKS = ("inverse_service.web.pages.result_tasks",)
WORDS: dict[str, Any] = tomllib.loads(
    (Path(__file__).parent / "words.toml").read_text(encoding="utf-8")
)
