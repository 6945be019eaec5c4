"""Programs that compute rates are read as their rates: random ones of three languages, in which the
entries of the state have names.
"""

import random
import re

import pytest

from inverse_service.service.documents.documents import parse_document
from tests.doors.judge import same_formula

POSITIONS = (("x", "y", "z"), ("theta", "phi", "psi"), ("q1", "q2", "q3"))
VELOCITIES = (("v{}", "p{}"), ("d{}", "{}dot", "{}_dot"))
TERMS = ("-k*{q}", "-c*{v}", "-sin({q})", "{q}*{p}", "-{v}*{p}", "-{q}^3", "cos(t)", "-1")
TERMS += ("-{q}/({q}^2 + {p}^2)^(3/2)", "-{v}^2/{q}", "2*{q}")


class Program:
    """A program of a seed, and the accelerations that it gives, by the names of the coordinates."""

    def __init__(self, seed: int) -> None:
        self.draw = draw = random.Random(seed)
        self.language = draw.choice(("Python", "MATLAB", "Julia"))
        self.positions = draw.choice(POSITIONS)[: draw.randint(1, 3)]
        form = draw.choice(draw.choice(VELOCITIES))
        self.velocities = [form.format(name) for name in self.positions]
        self.accelerations = [self._sum() for _ in self.positions]
        pairs = [*zip(self.positions, self.velocities, strict=True)]
        mixed = draw.random() < 0.5
        ordered = [name for pair in pairs for name in pair]
        self.state = ordered if mixed else [*self.positions, *self.velocities]
        self.array = draw.choice(("y", "s", "X", "state"))
        self.array = "S" if self.array in self.state else self.array
        self.out = draw.choice((f"d{self.array}", f"d{self.array}dt", "out"))
        self.out = f"d{self.array}" if self.language == "Julia" else self.out

    def _sum(self) -> str:
        q, p = self.draw.choices(self.positions, k=2)
        parts = self.draw.choices(TERMS, k=self.draw.randint(1, 2))
        v = self.draw.choice(self.velocities)
        return " + ".join(part.format(q=q, p=p, v=v) for part in parts)

    def entry(self, array: str, place: int) -> str:
        if self.language == "MATLAB":
            return f"{array}({place + 1})"
        return f"{array}[{place + (self.language == 'Julia')}]"

    def text(self) -> str:
        rates = dict(zip(self.positions, self.velocities, strict=True))
        rates |= dict(zip(self.velocities, self.accelerations, strict=True))
        end = ";" * (self.language == "MATLAB")
        entries = [self.entry(self.array, place) for place in range(len(self.state))]
        named = [f"{a} = {b}{end}" for a, b in zip(self.state, entries, strict=True)]
        if self.language != "MATLAB" and self.draw.random() < 0.6:
            whole = self.draw.choice((self.array, ", ".join(entries)))
            named = [f"{', '.join(self.state)} = {whole}"]
        listed = [rates[name] for name in self.state]
        body = [f"{self.entry(self.out, k)} = {rate}{end}" for k, rate in enumerate(listed)]
        match self.language:
            case "Python":
                if self.draw.random() < 0.5:
                    body = [f"return [{', '.join(listed)}]"]
                else:
                    body = [f"{self.out} = np.zeros({len(listed)})", *body, f"return {self.out}"]
                head = f"def rhs(t, {self.array}):"
                lines = [head, *(f"    {line}" for line in (*named, *body))]
                return re.sub(r"(sin|cos)\(", r"np.\1(", "\n".join(lines).replace("^", "**"))
            case "MATLAB":
                if self.draw.random() < 0.5:
                    body = [f"{self.out} = [{'; '.join(listed)}];"]
                head = f"function {self.out} = rhs(t, {self.array})"
            case _:
                head = f"function rhs!({self.out}, {self.array}, p, t)"
        return "\n".join((head, *named, *body, "end"))

    def meant(self) -> dict[str, str]:
        """The accelerations with q' for the velocities."""
        found = dict(zip(self.positions, self.accelerations, strict=True))
        for name, velocity in zip(self.positions, self.velocities, strict=True):
            found = {q: re.sub(rf"\b{velocity}\b", f"{name}'", text) for q, text in found.items()}
        return found


def assert_read(seeds: range) -> None:
    for seed in seeds:
        program = Program(seed)
        text = program.text()
        read = {
            name: part["text"]
            for name, part in parse_document({"equations": text})["equations"].items()
        }
        assert [*read] == [*program.positions], text
        for name, meant in program.meant().items():
            assert same_formula(read[name], meant, program.positions), (text, read)


def test_programs_are_read_as_their_rates() -> None:
    assert_read(range(6))


@pytest.mark.slow
def test_many_programs_are_read_as_their_rates() -> None:
    assert_read(range(6, 200))
