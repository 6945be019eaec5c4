"""The report as Markdown and as HTML."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence

from paper.statement import Section, Statement, Table

TITLE = "The paper, recomputed"
ABOUT = (
    "T. Mestdag, A. M. Bloch and O. E. Fernandez, Hamiltonization and geometric integration of nonholonomic mechanical "
    "systems (2009), statement by statement. Each line below was computed by the program; nothing is copied from the "
    "paper but its claims, in our words. Figures have the numbers of the paper as printed; its figure 1 draws the disk."
)
MEANING = {
    "agrees": "the computation gives what the paper says",
    "erratum": "the paper is wrong in print; the computation shows what is right",
    "correction": "what the paper concludes does not hold as stated",
    "differs": "the computation gives neither what the paper says nor what is known of its errata",
}


# How each statement is checked, by its key.
HOW = {
    "motion": "exact, modulo two primes at random points",
    "associated": "exact, modulo two primes at random points",
    "proposition-1-1": "a certificate for each system, found valid by the independent checker",
    "proposition-1-2": "a certificate for each system; the paper's L put into the Euler-Lagrange equations",
    "nabla-phi": "Hill's lunar problem, exact",
    "curvature": "geodesics of a metric in three dimensions, exact",
    "singular": "the null space of the conditions at a generic point",
    "hamiltonian": "the harmonic oscillator, exact",
    "proposition-2": "the Legendre transformation, exact",
    "circle": "three points of a circle",
    "disk-exact": "quadratures of the class against the formula, h = 0.2, T = 25",
    "disk-spiral": "simulation, h = 0.2",
    "disk-energy": "simulation, energy at the point of the discrete Lagrangian",
    "disk-modified": "simulation, radius of the matching circles",
    "disk-constraints": "simulation, greatest defect and its changes of sign",
    "disk-alpha": "simulation, T = 100, four values of alpha",
    "disk-unchanged": "simulation, T = 100, four values of alpha",
    "knife-edge": "simulation, h = 0.05, T = 40",
    "particle": "simulation, begun on the discrete constraint",
    "particle-alpha": "simulation, both starts, six values of alpha",
    "conclusion": "the simulations above",
    "potential": "certificates, found valid by the independent checker",
    "proposition-3": "certificates; a counterexample",
    "two-constraints": "certificates, found valid by the independent checker",
    "free-constants": "simulation for five values of C",
    "center": "simulation over 1,000,000 steps",
    "third": "simulation through A = 0",
    "inclined-edge": "simulation against the closed form of the motion",
}
# What the paper does not have, and where it is shown.
NEW = """## What is new here

- **The knife edge on an inclined plane is Hamiltonian.** Its associated systems of the first and second kind have
  no Lagrangian; another system with the same motions on the constraint has one. [Open
  questions](reference/open-questions.md) has the certificate's command.
- **Which motions have no Lagrangian at all.** For the class with a potential the question is decided for every
  associated system at once, by potential, with one and with two constraints: [the table of
  motions](reference/open-questions.md).
- **A third associated system**, whose Lagrangian is regular where A vanishes: [constrained
  systems](explanation/constrained-systems.md).
- **Systems outside the class**, Chaplygin's reduction, and changes of time: [constrained
  systems](explanation/constrained-systems.md).

[Records](records/paper.md) has every table and figure behind these rows, [the notebook](notebooks/paper.ipynb) a
short version to run.
"""


def side_by_side(sections: Sequence[Section]) -> str:
    """What the paper says, what is computed, and how it is checked: a row for each statement."""
    about = ABOUT.split(". Each line")[0] + "."
    lines = [f"# {TITLE}", "", about + " Bibliography: `docs/references.bib`. Made by `make paper`.", ""]
    lines += _table(_summary(sections))
    for section in sections:
        rows = tuple(
            (one.where, one.claim, f"**{one.finding}**: {one.computed}", f"{HOW.get(one.key, '')}; {one.code}")
            for one in section.statements
        )
        lines += [
            "",
            f"## {section.heading}",
            "",
            "| where | the paper | here | checked how |",
            "| --- | --- | --- | --- |",
        ]
        for where, claim, here, how in rows:
            finding, _, computed = here.partition(": ")
            cells = (_escaped(where), _escaped(claim), f"{finding}: {_escaped(computed)}", _escaped(how))
            lines.append("| " + " | ".join(cells) + " |")
    errata = [one for section in sections for one in section.statements if one.finding == "erratum"]
    lines += ["", "## Errata", "", *(f"- {_escaped(one.where)}: {_escaped(one.computed)}" for one in errata)]
    return "\n".join([*lines, "", NEW])


def counts(sections: Sequence[Section]) -> Counter[str]:
    """How many statements there are of each finding."""
    return Counter(statement.finding for section in sections for statement in section.statements)


def _summary(sections: Sequence[Section]) -> Table:
    found = counts(sections)
    rows = tuple((name, str(found[name]), meaning) for name, meaning in MEANING.items())
    return Table(("finding", "statements", "meaning"), rows)


def markdown(sections: Sequence[Section], figures: str, machine: str) -> str:
    """The report; `figures` is the folder of the pictures, seen from the page."""
    lines = [f"# {TITLE}", "", ABOUT, "", "Made by `make paper`. " + machine, ""]
    lines += _table(_summary(sections))
    for section in sections:
        lines += ["", f"## {section.heading}"]
        for statement in section.statements:
            lines += ["", *_statement(statement, figures)]
    return "\n".join(lines) + "\n"


def _statement(statement: Statement, figures: str) -> list[str]:
    lines = [
        f"### {_escaped(statement.where)}: {statement.finding}",
        "",
        f"> {_escaped(statement.claim)}",
        "",
        _escaped(statement.computed),
    ]
    for table in statement.tables:
        lines += ["", *_table(table)]
    for figure in statement.figures:
        picture = f"![{_escaped(figure.description)}]({figures}/{figure.name}.svg)"
        lines += ["", picture, "", f"*{_escaped(figure.caption)}*"]
    return [*lines, "", f"Code: `{statement.code}`"]


def _escaped(text: str) -> str:
    """Plain text in Markdown: powers and primes stay, stars and angle brackets are no marks."""
    return text.replace("*", r"\*").replace("<", "&lt;").replace("_", r"\_").replace("|", r"\|")


def _table(table: Table) -> list[str]:
    rule = ["---"] * len(table.head)
    rows = [table.head, tuple(rule), *(tuple(_cell(cell) for cell in row) for row in table.rows)]
    return ["| " + " | ".join(row) + " |" for row in rows]


def _cell(text: str) -> str:
    return f"`{text}`" if any(mark in text for mark in "*^_'") and "`" not in text else text.replace("|", r"\|")


def page(sections: Sequence[Section], figures: str, machine: str) -> str:
    """The same report as one HTML page that loads nothing but its figures."""
    body = [f"<h1>{TITLE}</h1>", f"<p>{html.escape(ABOUT)}</p>"]
    body.append(f"<p>Made by <code>make paper</code>. {html.escape(machine)}</p>")
    body.append(_html_table(_summary(sections)))
    for section in sections:
        body.append(f"<h2>{html.escape(section.heading)}</h2>")
        body += [_html_statement(statement, figures) for statement in section.statements]
    return _FRAME.format(title=TITLE, body="\n".join(body))


def _html_statement(statement: Statement, figures: str) -> str:
    parts = [
        f'<section id="{statement.key}">',
        f'<h3>{html.escape(statement.where)}: <span class="{statement.finding}">{statement.finding}</span></h3>',
        f"<blockquote>{html.escape(statement.claim)}</blockquote>",
        f"<p>{html.escape(statement.computed)}</p>",
        *(_html_table(table) for table in statement.tables),
    ]
    for figure in statement.figures:
        source, alternative = f"{figures}/{figure.name}.svg", html.escape(figure.description, quote=True)
        parts.append(f'<figure><img src="{source}" alt="{alternative}">')
        parts.append(f"<figcaption>{html.escape(figure.caption)}</figcaption></figure>")
    parts.append(f"<p>Code: <code>{html.escape(statement.code)}</code></p></section>")
    return "\n".join(parts)


def _html_table(table: Table) -> str:
    head = "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in table.head)
    rows = "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table></div>'


_FRAME = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.55 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }}
blockquote {{ margin: .5rem 0; padding-left: 1rem; border-left: 3px solid #8884; }}
table {{ border-collapse: collapse; font-size: .9rem; }}
th, td {{ border-bottom: 1px solid #8884; padding: .25rem .6rem; text-align: left; }}
.table {{ overflow-x: auto; }}
figure {{ margin: 1rem 0; }}
img {{ max-width: 100%; background: #fff; }}
.agrees {{ color: #1a7f37; }} .erratum, .correction {{ color: #b35900; }} .differs {{ color: #c1121f; }}
@media (prefers-color-scheme: dark) {{
  .agrees {{ color: #56d364; }} .erratum, .correction {{ color: #f0a35e; }} .differs {{ color: #ff7b72; }}
}}
</style>
</head>
<body>
{body}
</body>
</html>
"""
