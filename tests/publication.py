"""Write the names and addresses of publication.toml where others read them: `python -m
tests.publication`.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def publication() -> dict[str, Any]:
    return tomllib.loads((ROOT / "publication.toml").read_text(encoding="utf-8"))


def citation(text: str, about: dict[str, Any]) -> str:
    """CITATION.cff with these authors and this repository."""
    authors = "".join(f'  - name: "{one["name"]}"\n' for one in about["authors"])
    text = re.sub(r"(?m)^authors:\n(?:  .*\n)+?(?=^\S)", f"authors:\n{authors}", text, count=1)
    return re.sub(r"(?m)^repository-code: .*$", f'repository-code: "{about["repository"]}"', text)


def manuscript(text: str, about: dict[str, Any]) -> str:
    """paper.md with the head that these authors make."""
    places = list(dict.fromkeys(one["affiliation"] for one in about["authors"]))
    authors = "".join(
        f"  - name: {one['name']}\n    orcid: {one['orcid']}\n    affiliation: {1 + places.index(one['affiliation'])}\n"
        for one in about["authors"]
    )
    named = "".join(
        f"  - name: {place}\n    index: {number}\n" for number, place in enumerate(places, 1)
    )
    head = f"authors:\n{authors}affiliations:\n{named}"
    text = re.sub(r"(?ms)^authors:\n.*?(?=^date:)", head, text, count=1)
    return re.sub(r"<https://[^>]*>(?=, version)", f"<{about['repository']}>", text)


FILES = {"CITATION.cff": citation, "paper/paper.md": manuscript}


def main() -> None:
    for name, written in FILES.items():
        path = ROOT / name
        path.write_text(written(path.read_text(encoding="utf-8"), publication()), encoding="utf-8")


if __name__ == "__main__":
    main()
