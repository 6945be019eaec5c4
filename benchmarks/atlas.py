"""The atlas: every named system of the catalogue and of the lists of the tests, with its computed
answers.

`python -m benchmarks.atlas` solves all of them and writes
inverse_service/catalogue/entries/atlas.ndjson; `--only NAME` solves one and prints its line,
`--check DAY` compares the lines of a day with what is computed now, and `--resume` keeps the lines
of the file, and of an interrupted run, whose documents are unchanged. A system that stays undecided
at `--time-limit` is omitted.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import re
import signal
import sys
import time
import tomllib
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import members_of_families
from inverse_service import __version__, catalogue, solve
from inverse_service.errors import InputError
from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics import book_forms, writing
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents import (
    family_tables,
    printed_pages,
    sheets,
    short_results,
    stated,
)
from inverse_service.service.documents.alike import form_of

ROOT = Path(__file__).parents[1]
FILE = ROOT / "inverse_service" / "catalogue" / "entries" / "atlas.ndjson"
UNFINISHED = FILE.with_suffix(".part")
EACH_DAY = 40  # entries that are solved again
TIME_LIMIT = 20.0  # seconds of processor time for a system
LONGER = 3  # times as long, before an entry is said to differ
HARD = 2  # times that: a system is always stopped
# Test lists whose documents are systems from users' questions, and the tag of each.
LISTS = {
    "literature": "literature",
    "kamke": "Kamke",
    "textbook": "textbook",
    "constrained": "constraints",
    "books": "books",
    "integrals": "first integrals",
    "search": "search",
}
FAMILY = "family"  # the tag of a family, all of whose members are decided
# Families of which all members are decided in seconds, by their numbers in
# docs/records/families.md.
COVERED = frozenset((
    "1", "2", "2b", "4", "5s", "6d", "7b", "10b", "11", "11b", "11c", "12", "13", "14", "16", "17", "18", "19", "20",
    "22", "26", "27",
))  # fmt: skip
# Lists of which only systems with a source are entries, and of these each form once.
CITED = ("books", "integrals", "search")
# Of a system that books' rows write in several ways, the equations as the book has them.
AS_PRINTED = "-lines"
# What the names of rows say besides the system.
ROW_WORDS = re.compile(r"^(book|integrals|one)[- ]")
# Parts of a source that are our own notes, not a citation.
OWN = re.compile(
    r"\bown\b|^textbook\b|regression|attacks|by hand|worked out|random search|verdict|\btests?\b|identity checked"
    r"|^6-dim$|^n=1$|always works|made from|each is differentiated|second one of degree|last multipliers|exponential factors"
)
NAMES = (
    *(
        "Pol",
        "Kepler",
        "Lienard",
        "Painleve",
        "Emden",
        "Fowler",
        "Fermi",
        "Henon",
        "Heiles",
        "Plesset",
        "Langmuir",
    ),
    *(
        "Boltzmann",
        "Poisson",
        "Bateman",
        "Yang",
        "Mills",
        "Lotka",
        "Volterra",
        "Euler",
        "Suslov",
        "Caldirola",
        "Douglas",
    ),
    *(
        "Moser",
        "Lakshmanan",
        "Pinney",
        "Coulomb",
        "Toda",
        "Landau",
        "RLC",
        "GL2",
        "SL2",
        "SO3",
        "SE3",
        "FPUT",
    ),
)
TITLES: dict[str, str] = tomllib.loads(
    (Path(__file__).parent / "atlas_titles.toml").read_text(encoding="utf-8")
)
SOURCES: dict[str, dict[str, str]] = tomllib.loads(
    (Path(__file__).parent / "atlas_sources.toml").read_text(encoding="utf-8")
)
WORKS = SOURCES["works"]
SHORT_NAMES = re.compile(
    rf"(?<![\w.])(?<!\. )({'|'.join(sorted(map(re.escape, WORKS), key=len, reverse=True))})(?!\w)"
)
IN_BRACKETS = re.compile(rf"^.* \(({SHORT_NAMES.pattern}[^()]*)\)$")  # behind words of a row
VARIATION = "variation of "
# What a part of a source has if it is a citation, and not a note: a year, a place in a book, an
# address.
CITATION = re.compile(
    r"\b(?:1[5-9]|20)\d\d\b|\b(?:chapter|section|sections|exercise|appendix)\b|equation \d|\b\d+\.\d+\b|arXiv|doi|github"
    r"|stackexchange|mathoverflow|forums|\bInt\. J\.",
    re.I,
)
# What a row says of a cited system behind its citation.
NOTE = re.compile(
    r"(?<=\d{4}): [a-zA-Z].*$|(?<=\d{4})(?::| \(|,) (?:L = |q'' ).*$| with Gamma_2.*$|: robot with .*$|(?<=255): .*$"
)
# Books of which a row names no place, and questions by the short names of their sites.
WHOLE = (
    (re.compile(r"^Whittaker$"), "Whittaker, Analytical Dynamics"),
    (re.compile(r"^Jose and Saletan$"), "Jose and Saletan, Classical Dynamics"),
    (re.compile(r"^Landau and Lifshitz, (?:Fields|Field theory)$"), "Landau and Lifshitz, The Classical Theory of Fields"),
    (re.compile(r"^Jordan and Smith$"), "Jordan and Smith, Nonlinear Ordinary Differential Equations"),
    (re.compile(r"^(mathematica|physics)\.SE (\d+).*"), r"\1.stackexchange.com/questions/\2"),
    (re.compile(r"^(Physics Forums \d+|MathOverflow \d+)\b.*"), r"\1"),
    (re.compile(r".*Patera-Sharp-Winternitz-Zassenhaus$"),
     "Patera, Sharp, Winternitz, Zassenhaus, J. Math. Phys. 17 (1976) 986"),
    (re.compile(r"^Strugar(?:-|, )Thompson.*"), "Strugar, Thompson, Houston J. Math. 35 (2009) 373"),
    (re.compile(r"^Caldirola-Kanai.*"), "Caldirola 1941, Kanai 1948"),
    (re.compile(r"^Hamiltonian by Malmquist, Okamoto$"), "Okamoto 1987"),
    (re.compile(r"^Painleve/Okamoto$"), "Painleve 1902"),
    (re.compile(r"^Danby / Gorringe-Leach.*"), "Gorringe, Leach, Celest. Mech. 41 (1988) 125"),
    (re.compile(r".*Nayfeh and Mook$"), "Nayfeh, Mook, Nonlinear Oscillations 1979"),
    (re.compile(r"^Newton(?:'s bodies in a plane)?$"), "Newton 1687"),
    (re.compile(r"^Galilei$"), "Galilei 1638"),
    (re.compile(r"^Landau$"), "Landau 1930"),
    (re.compile(r"^Poincare(?: half-plane.*)?$"), "Poincare 1882"),
    (re.compile(r"^Penning, Dehmelt$"), "Penning 1936"),
    (re.compile(r"^Jacobi, Szebehely$"), "Szebehely, Theory of Orbits 1967"),
    (re.compile(r"^Maupertuis, Jacobi$"), "Jacobi, Vorlesungen ueber Dynamik 1866"),
    (re.compile(r"^Jacobi, the geodesics of an ellipsoid$"), "Jacobi 1839"),
    (re.compile(r"^Shimada: .*"), "Shimada 1979"),
    (re.compile(r"^Matsumoto, Numata: .*"), "Matsumoto, Numata 1979"),
    (re.compile(r"^(?:Douglas (?:case |IIa2|IIIb)|IIa2: ).*"), "Douglas 1941"),
    (re.compile(r"^Jeffcott rotor.*"), "Jeffcott 1919"),
    (re.compile(r"^open Toda lattice$"), "Toda 1967"),
    (re.compile(r"^Bateman (?:doubling|pair).*"), "Bateman 1931"),
    (re.compile(r"^Lane-Emden, index 5$"), "Emden 1907"),
    (re.compile(r"^(Landau, Lifshitz, The Classical Theory of Fields), (\d+)$"), r"\1, section \2"),
)  # fmt: skip
# The books that rows name by their authors, as a reader finds them in a library.
BOOKS = {
    "Arnold": "V. I. Arnold, Mathematical Methods of Classical Mechanics",
    "Arnold, Mathematical aspects":
        "V. I. Arnold, V. V. Kozlov, A. I. Neishtadt, Mathematical Aspects of Classical and Celestial Mechanics",
    "Calkin": "M. G. Calkin, Lagrangian and Hamiltonian Mechanics",
    "Fasano and Marmi": "A. Fasano, S. Marmi, Analytical Mechanics",
    "Goldstein": "H. Goldstein, Classical Mechanics",
    "Goldstein, Poole, Safko 2002": "H. Goldstein, C. P. Poole, J. L. Safko, Classical Mechanics (2002)",
    "Hamill": "P. Hamill, A Student's Guide to Lagrangians and Hamiltonians",
    "Hand and Finch": "L. N. Hand, J. D. Finch, Analytical Mechanics",
    "Jose and Saletan": "J. V. Jos\u00e9, E. J. Saletan, Classical Dynamics",
    "Landau and Lifshitz 1976": "L. D. Landau, E. M. Lifshitz, Mechanics (1976)",
    "Landau, Fields": "L. D. Landau, E. M. Lifshitz, The Classical Theory of Fields",
    "Landau, Lifshitz 1975": "L. D. Landau, E. M. Lifshitz, The Classical Theory of Fields (1975)",
    "Landau, Mechanics": "L. D. Landau, E. M. Lifshitz, Mechanics",
    "Landau, Theory of Fields": "L. D. Landau, E. M. Lifshitz, The Classical Theory of Fields",
    "Marion and Thornton": "J. B. Marion, S. T. Thornton, Classical Dynamics of Particles and Systems",
    "Morin": "D. Morin, Introduction to Classical Mechanics",
    "Perelomov": "A. M. Perelomov, Integrable Systems of Classical Mechanics and Lie Algebras",
    "Taylor": "J. R. Taylor, Classical Mechanics",
    "Whittaker": "E. T. Whittaker, A Treatise on the Analytical Dynamics of Particles and Rigid Bodies",
    "Whittaker, Analytical Dynamics":
        "E. T. Whittaker, A Treatise on the Analytical Dynamics of Particles and Rigid Bodies",
}  # fmt: skip
# A place in a book, or nothing more.
IN_BOOK = re.compile(
    rf"^({'|'.join(sorted(map(re.escape, BOOKS), key=len, reverse=True))})"
    r"(?=, (?:chapter|section|sections|appendix|exercise|problem|\d)|$)"
)
SPELLING = {name.lower(): name for name in NAMES}
# Names as their owners write them, in titles and citations.
ACCENTS = {
    "Painleve": "Painlev\u00e9", "Henon": "H\u00e9non", "Poincare": "Poincar\u00e9", "Lienard": "Li\u00e9nard",
    "Jose and": "Jos\u00e9 and", "ueber": "\u00fcber",
}  # fmt: skip
WORDS = (
    *(
        "damped",
        "kepler",
        "pendulum",
        "oscillator",
        "drag",
        "magnetic",
        "geodesic",
        "painleve",
        "disk",
        "sleigh",
    ),
    *(
        "lienard",
        "knife",
        "sphere",
        "spring",
        "henon",
        "toda",
        "top",
        "robot",
        "orbit",
        "friction",
        "relativ",
    ),
)
TILTED = (
    "m/2*((x' - R*(theta'*cos(theta)*sin(psi) + psi'*sin(theta)*cos(psi)))^2"
    " + (y' + R*(theta'*cos(theta)*cos(psi) - psi'*sin(theta)*sin(psi)))^2 + R^2*theta'^2*sin(theta)^2)"
    " + A/2*(theta'^2 + psi'^2*cos(theta)^2) + C/2*(phi' + psi'*sin(theta))^2 - m*g*R*cos(theta)"
)
MORE = (
    {
        "id": "tilting-disk",
        "title": "rolling disk that tilts",
        "source": "github.com/sympy/sympy/issues/27631",
        "document": {
            "coordinates": ["psi", "theta", "phi", "x", "y"],
            "lagrangian": TILTED,
            "constraints": ["x' + R*cos(psi)*phi'", "y' + R*sin(psi)*phi'"],
            "parameters": ["m", "R", "A", "C", "g"],
        },
        "tags": ["constraints"],
    },
)


def documents() -> Iterator[dict[str, Any]]:
    """{name, title, source, document, tags} of every system, each question once."""
    seen, names = set[str](), set[str]()
    for row in _rows():
        document = {
            key: value
            for key, value in row["document"].items()
            if key not in ("options", "kinds", "id")
        }
        key = json.dumps(document, sort_keys=True)
        if key not in seen and row["name"] not in names:
            seen.add(key)
            names.add(row["name"])
            yield {**row, "document": document}


def _rows() -> Iterator[dict[str, Any]]:
    for kind in ("system", "nonholonomic"):
        for name in catalogue.names(kind):
            entry = catalogue.entry(name)
            yield _row(name, entry["title"], entry.get("source", ""), entry["document"], [])
    for list_name, tag in LISTS.items():
        lines = (
            (ROOT / "tests" / "corpus" / f"{list_name}.ndjson")
            .read_text(encoding="utf-8")
            .splitlines()
        )
        for line in map(json.loads, lines):
            is_left_out = list_name in CITED and not citation(line.get("source", ""))
            if is_left_out or (list_name == "books" and not line["id"].endswith(AS_PRINTED)):
                continue
            if isinstance(line.get("document"), dict) and "clock" not in line:
                name = ROW_WORDS.sub("", line["id"].removesuffix(AS_PRINTED))
                yield _row(name, "", line.get("source", ""), line["document"], [tag])
    for key, document in members_of_families.FAMILIES.items():
        number, _, name = key.partition(" ")
        if number in COVERED:
            asked = {**document, "family": True}
            yield _row(f"family {name}", f"Family: {name}", "", asked, [FAMILY])
    for more in MORE:
        yield _row(more["id"], more["title"], more["source"], more["document"], more["tags"])


def _row(name: Any, title: Any, source: Any, document: Any, tags: Any) -> dict[str, Any]:
    slug = _slug(str(name).replace("kamke_", "kamke-"))
    words = re.sub(
        r"^(textbook|asked|clock|any|constrained|reduced|motion|nonholonomic) ",
        "",
        slug.replace("-", " "),
    )
    if kamke := re.fullmatch(r"kamke (\d) (\d+)", words):
        number = ".".join(kamke.groups())
        title, source = (
            f"Kamke {number}",
            f"E. Kamke, Differentialgleichungen I (1942), equation {number}",
        )
    else:
        source = citation(SOURCES["entries"].get(slug, str(source)))
    return {
        "name": slug,
        "title": accented(TITLES.get(slug) or title or _title(words, source, document)),
        "source": accented(source),
        "document": document,
        "tags": tags,
    }


def accented(text: str) -> str:
    """A text with the names in it as their owners write them."""
    for plain, own in ACCENTS.items():
        text = text.replace(plain, own)
    return text


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def _title(words: str, source: str, document: Any) -> str:
    """The title for a name: a force by its formula, the source if it says the same, else the words
    of the name with proper capitals.
    """
    if words.startswith("force "):
        text = document["equations"] if isinstance(document, Mapping) else ""
        text = next(iter(text.values())) if isinstance(text, Mapping) else text.partition("=")[2]
        return f"Force {text.strip()}"
    same = source.partition(" (")[0]
    if _slug(same) == _slug(words):
        words = same
    spelled = SPELLING | {word.lower(): word for word in re.findall(r"[A-Z][a-z]{2,}", source)}
    words = re.sub(r"[A-Za-z]+\d?", lambda word: spelled.get(word[0].lower(), word[0]), words)
    words = re.sub(
        r"^[Ll]ie ([a-z]\d) (\d+)", lambda found: f"Lie group {found[1].upper()},{found[2]}", words
    )
    words = re.sub(
        r"^((?:case|Case|Painleve) )([iv]+)", lambda found: found[1] + found[2].upper(), words
    )
    return words[:1].upper() + words[1:]


def citation(source: str) -> str:
    """A source in the words of a citation: the parts between semicolons that are not notes."""
    if source.startswith("own"):
        return ""
    source = re.sub(r"\s*\((?:Jacobi identity checked|three classes are obstructed)\)", "", source)
    source = re.sub(r"\s*exceptional parameter found.*", "", source)
    parts = list[str]()
    for part in re.split(r";\s|;$|, own computation|(?=verdict:)", source):
        part = part.strip()
        if OWN.search(part):
            continue
        whole = next((shape.sub(said, part) for shape, said in WHOLE if shape.match(part)), "")
        if whole or CITATION.search(part):
            parts.append(in_full(whole or NOTE.sub("", part)))
    return "; ".join(dict.fromkeys(parts))


def in_full(part: str) -> str:
    """A part of a source with the title of its book or paper."""
    said = part.removeprefix(VARIATION)
    whole = IN_BOOK.sub(lambda found: BOOKS[found[1]], IN_BRACKETS.sub(r"\1", said))
    return part[: len(part) - len(said)] + SHORT_NAMES.sub(lambda found: WORKS[found[1]], whole)


def entry_of(row: Mapping[str, Any], time_limit: float = TIME_LIMIT) -> dict[str, Any]:
    """The line of the atlas for a system: its result in short, as computed now."""
    signal.signal(signal.SIGVTALRM, _overrun)
    signal.setitimer(signal.ITIMER_VIRTUAL, HARD * time_limit)
    began = time.process_time()
    try:
        result = solve(dict(row["document"]), time_limit=time_limit)
    except (InputError, TimeoutError) as error:
        return {**row, "refused": str(error) or "It took too long."}
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    if "verdict" not in result:
        return {**row, "refused": "It is a Lagrangian, not equations."}
    if sheets.verdict_of(result) == sheets.OPEN and time_limit < TIME_LIMIT:
        return {**row, "refused": "It was not decided within the time limit."}
    sheet, system = sheets.sheet_of(result, length="brief"), result["system"] or {}
    verdict, badge = sheet.verdict, sheet.badge
    is_plain = bool(system) and not stated.is_constrained(result)
    if FAMILY in row["tags"]:
        if not (result.get("family") or {}).get("covered"):
            return {**row, "refused": "Not every member is decided."}
        verdict, badge = family_tables.badge_of(result)
    return {
        "name": row["name"],
        "title": row["title"],
        "source": row["source"],
        "tags": tags_of(row, result, badge, sheet),
        "document": row["document"],
        "equations": [formula.whole for formula in sheet.asked],
        "verdict": verdict,
        "badge": badge,
        "form": form_of(system) if is_plain else "",
        "at_rest": form_of(system, at_rest=True) if is_plain else "",
        "seconds": round(time.process_time() - began, 2),
        "result": short_results.shortened(result),
    }


def _overrun(*_: Any) -> None:
    """Stop a system whose stages do not check the clock."""
    raise TimeoutError


def tags_of(
    row: Mapping[str, Any], result: Mapping[str, Any], badge: str, sheet: sheets.Sheet
) -> list[str]:
    """The search tags besides the name: origin, number of coordinates, verdict, and subject."""
    system = result["system"] or {"coordinates": (), "functions": ()}
    count = len(system["coordinates"])
    text = f"{row['name']} {row['title']}".lower()
    found = [*row["tags"], f"{count} coordinate{'s' if count != 1 else ''}", badge]
    found += ["constraints"] if stated.is_constrained(result) else []
    found += (
        ["with time only"]
        if printed_pages.plain_text(sheet.sentence).endswith("with the time in L.")
        else []
    )
    found += ["arbitrary functions"] if system.get("functions") else []
    found += [word for word in WORDS if word in text]
    return list(dict.fromkeys(found))


def main() -> int:
    """Write the atlas, print one line of it, or compare some."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--check", type=int, metavar="DAY")
    parser.add_argument("--time-limit", type=float, default=TIME_LIMIT)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    rows = list(documents())
    if options.only:
        print(
            json.dumps(
                entry_of(next(row for row in rows if row["name"] == options.only)),
                ensure_ascii=False,
            )
        )
        return 0
    if options.check is not None:
        return _compared(rows, options.check)
    return _written(rows, options.time_limit, options.resume, options.processes)


def _written(rows: list[dict[str, Any]], time_limit: float, resume: bool, processes: int) -> int:
    known = (
        {entry["name"]: entry for file in (FILE, UNFINISHED) for entry in _lines(file)}
        if resume
        else {}
    )
    solved = {
        row["name"]: known[row["name"]] for row in rows if is_current(row, known.get(row["name"]))
    }
    waiting = [row for row in rows if row["name"] not in solved]
    with UNFINISHED.open("w", encoding="utf-8") as part, multiprocessing.Pool(processes) as pool:
        part.writelines(_line(entry) for entry in solved.values())
        for k, entry in enumerate(
            pool.imap(partial(_entry_or_fault, time_limit=time_limit), waiting), 1
        ):
            solved[entry["name"]] = entry
            if "refused" in entry:
                print(f"{entry['name']}: {entry['refused']}", file=sys.stderr)
                continue
            part.write(_line(entry))
            part.flush()
            if k % 50 == 0:
                print(f"{k} of {len(waiting)}", file=sys.stderr)
    entries, forms = list[dict[str, Any]](), set[str]()
    for row in rows:
        entry = solved[row["name"]]
        # A known system with other numbers is left out, if it is no family and has no title or
        # source of its own.
        if "refused" not in entry and not (
            row["tags"]
            and FAMILY not in row["tags"]
            and (
                (not row["source"] and row["name"] not in TITLES)
                or {*row["tags"]} & {LISTS[name] for name in CITED}
            )
            and entry["form"] in forms - {""}
        ):
            forms.add(entry["form"])
            entries.append(entry | {key: row[key] for key in ("title", "source")})
    FILE.write_text("".join(map(_line, entries)), encoding="utf-8")
    UNFINISHED.unlink()
    print(f"{len(entries)} systems", file=sys.stderr)
    return 0


def _entry_or_fault(row: Mapping[str, Any], time_limit: float) -> dict[str, Any]:
    """The line of the atlas; one system at which the program fails does not end the run."""
    try:
        return entry_of(row, time_limit)
    except Exception as error:
        return {**row, "refused": f"FAULT {type(error).__name__}: {error}"}


def is_current(row: Mapping[str, Any], entry: Mapping[str, Any] | None) -> bool:
    """Whether an entry is a result of this version about the row's document."""
    made = (entry or {}).get("result", {}).get("provenance", {}).get("version")
    return entry is not None and entry["document"] == row["document"] and made == __version__


def _line(entry: Mapping[str, Any]) -> str:
    return json.dumps(entry, ensure_ascii=False, separators=(",", ":")) + "\n"


def _lines(file: Path = FILE) -> list[dict[str, Any]]:
    """The entries of a file; an interrupted last line is left out."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def differences(entry: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What an entry says less or otherwise than the program says now; the same formula written in
    another form is no difference.
    """
    if "refused" in now:
        return [now["refused"]]
    found = [
        f"{key}: {entry[key]} / {now[key]}"
        for key in ("equations", "verdict", "badge")
        if entry[key] != now[key]
    ]
    both = [short_results.for_programs(one["result"])["answers"] for one in (entry, now)]
    stored, computed = (
        {(stated.question_of(one), one["cell"]): one for one in each} for each in both
    )
    words = stated.names_of(
        short_results.unfolded(now["result"], now["document"])["system"] or {},
        {name: {"arguments": known} for name, known in _integrals(both[1]).items()},
    )
    for key in dict.fromkeys([*stored, *computed]):
        one, other = stored.get(key, {}), computed.get(key, {})
        names = [
            name
            for name in dict.fromkeys([*one, *other])
            if not _says_the_same(one.get(name), other.get(name), words)
        ]
        found += [f"{key[0]}, {name}: {one.get(name)} / {other.get(name)}"[:300] for name in names]
    return found


def unlike(entry: Mapping[str, Any], row: Mapping[str, Any]) -> list[str]:
    """What an entry says less or otherwise than the program does. Where they differ, the program
    gets more time: on a slow machine its limit ends a search.
    """
    return differences(entry, entry_of(row)) and differences(
        entry, entry_of(row, LONGER * TIME_LIMIT)
    )


def _integrals(answers: list[dict[str, Any]]) -> dict[str, Any]:
    """The functions F in the Lagrangians of the answers with their arguments."""
    parts = [one.get("lagrangian") or {} for one in answers]
    return {
        name: known["arguments"]
        for part in parts
        for name, known in (part.get("auxiliary") or {}).items()
    }


def _says_the_same(one: Any, other: Any, words: Names) -> bool:
    """Whether two parts of answers are equal, or have equal formulas; LaTeX follows from the text,
    and M and V from H.
    """
    if one == other:
        return True
    match one, other:
        case [dict(), dict()]:
            keys = {*one, *other} - {"latex", "mass_matrix", "potential"}
            return all(_says_the_same(one.get(key), other.get(key), words) for key in keys)
        case [list(), list()]:
            return len(one) == len(other) and all(
                _says_the_same(*pair, words) for pair in zip(one, other, strict=True)
            )
        case [str(), str()]:
            try:
                left, right = (
                    book_forms.in_one_logarithm(collecting.collect(read_formula(text, words)))
                    for text in (one, other)
                )
            except InputError:
                return False
            return collecting.collect(left - right) == ex.ZERO or bool(
                writing.exact_quotient(left - right) == ex.ZERO
            )
    return False


def of_day(day: int) -> list[dict[str, Any]]:
    """Some forty entries of the file, other ones each day of half a month."""
    entries = _lines()
    step = max(1, len(entries) // EACH_DAY)
    return entries[day % step :: step]


def _compared(rows: list[dict[str, Any]], day: int) -> int:
    """Return 1 if an entry of the day says less or other than what is computed now."""
    known = {row["name"]: row for row in rows}
    failed = False
    for entry in of_day(day):
        for difference in unlike(entry, known[entry["name"]]):
            failed = True
            print(f"{entry['name']}: {difference}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
