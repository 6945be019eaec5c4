"""Sets of exercises: own numbers for each student, and marks that only codes of this service give."""

from __future__ import annotations

import csv
import html
import io
import re
from urllib.parse import parse_qs, urlencode, urlparse

import httpx
import pytest

from inverse_service.web.pages import classes, exercises, forms

SET = "# Friction\nx'' = -[2..9] x - [1..4] x'\nx'' = -[-3..-3] x"


def test_a_set_is_titles_and_equations() -> None:
    assert classes.tasks_of(SET) == (
        classes.Task("Friction", "x'' = -[2..9] x - [1..4] x'"),
        classes.Task("Exercise 2", "x'' = -[-3..-3] x"),
    )


@pytest.mark.parametrize(("text", "said"), [
    ("", "at least one line"), ("# only a title", "at least one line"), ("x'' = -[9..2] x", "[2..9]"),
    ("x'' = -x\n" * 41, "at most 40"), ("x" * 4_001, "at most 4000"),
    ("x'' = -[k=2..9] x - [k=1..4] x'", "[k=...] stands twice"),
])  # fmt: skip
def test_a_set_that_is_none_says_what_to_write(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        classes.tasks_of(text)


def test_numbers_lie_in_their_ranges_stay_and_differ_between_students() -> None:
    text = classes.tasks_of(SET)[0].equations
    seen = {name: classes.drawn(SET, name, 0, text) for name in map(str, range(60))}
    numbers = [re.fullmatch(r"x'' = -(\d) x - (\d) x'", line) for line in seen.values()]
    assert {found[1] for found in numbers if found} == set("23456789")
    assert {found[2] for found in numbers if found} == set("1234")
    assert all(numbers)
    assert seen == {name: classes.drawn(SET, name, 0, text) for name in seen}
    assert classes.drawn(SET, "A", 0, "x'' = -[-3..-3] x") == "x'' = -(-3) x"


def test_a_named_number_stands_again_where_its_name_does() -> None:
    """A turning frame has one w: x'' = 2 w y', y'' = -2 w x'."""
    text = "x'' = [w=2..6] y'; y'' = -[w] x' - Sin[x]"
    seen = {classes.drawn(text, name, 0, text) for name in map(str, range(40))}
    assert seen == {f"x'' = {w} y'; y'' = -{w} x' - Sin[x]" for w in range(2, 7)}


def test_a_set_with_an_exercise_that_cannot_be_read_says_which_one() -> None:
    """A class cannot correct what its teacher typed."""
    tasks = classes.tasks_of("# Fall\ny'' = -g\n# Spring\nx'' = -c x' - k x; c = 1..5")
    read = classes.readings_task([task.equations for task in tasks])
    assert "understood" in read[0]
    (other,) = classes.readings_task(["x'' = -1/2k x"])  # whose other reading has no form to go to
    assert other["understood"].readings
    assert not any(sends for *_, sends in other["understood"].readings)
    with pytest.raises(ValueError, match=r"^Spring, x'' = -c x' - k x; c = 1\.\.5: "):
        classes.refuse_unread(tasks, read)
    classes.refuse_unread(tasks[:1], read[:1])
    classes.refuse_unread(tasks, [{}, {}])  # a busy service has read nothing


def test_names_come_with_their_codes_however_they_are_written() -> None:
    one, two = "2026-11-28-0123456789ab", "2026-11-29-ba9876543210"
    text = f"Ada L.; {one}, {two}\n\nBob\t{one}\nAda L.: {one}\nNobody"
    assert classes.rows_of(text) == [
        ("Ada L.", frozenset({one, two})),
        ("Bob", frozenset({one})),
        ("Nobody", frozenset()),
    ]


@pytest.mark.parametrize(("text", "said"), [
    ("Ada\n2026-11-28-0123456789ab", "Line 2 has codes and no name"),
    ("\n".join(f"S{k}" for k in range(1_001)), "1000 students at once"),
    ("Ada " + " ".join(f"2026-11-28-{k:012x}" for k in range(81)), "Ada has more than 80 codes"),
])  # fmt: skip
def test_no_student_and_no_code_is_left_out_in_silence(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        classes.rows_of(text)


@pytest.mark.parametrize("line", ["Ada; 2026-11-28-0123456789", "Ada; 2026-11-28-0123456789ab, x"])
def test_what_is_no_code_is_named(line: str) -> None:
    with pytest.raises(ValueError, match=r"Line 1: '.*' is no code; write a code as"):
        classes.rows_of(line)


def test_no_cell_of_the_marks_is_a_formula() -> None:
    tasks = (classes.Task("=1+1", ""),)
    rows = list(csv.reader(io.StringIO(classes.as_csv(tasks, [classes.Marked("@x", (True,))]))))
    assert rows == [["student", "'=1+1", "solved"], ["'@x", "1", "1"]]


@pytest.mark.slow
def test_a_class_from_the_set_to_the_marks(client: httpx.Client) -> None:
    text = "# One\nx'' = -[2..9] x\n# None\nx'' = -x; y'' = -[2..5] y - y' + x x'"
    made = client.get("/class/new", params={"set": text, "title": "Week 3"})
    assert made.status_code == 200
    assert "/class?" in made.text
    assert made.text.count('class="small reading"') == 2
    page = client.get("/class", params={"set": text, "student": "Ada"})
    links = re.findall(r'href="(/exercise\?[^"]+)"', page.text)
    assert len(links) == 2
    address = links[0].replace("&amp;", "&")
    (equations,) = parse_qs(urlparse(address).query)["equations"]
    found = re.fullmatch(r"x'' = -(\d) x", equations)
    assert found is not None

    assert '<input type="hidden" name="student" value="Ada">' in client.get(address).text

    def judged(own: str) -> str:
        return client.get(f"{address}&{urlencode({'answer': 'one', 'own': own})}").text

    assert "Code for your teacher" not in judged("x'^2/2")
    right = judged(f"x'^2 - {found[1]}*x^2")
    (code,) = re.findall(r"<code>(\d{4}-\d\d-\d\d-[0-9a-f]{12})</code>", right)
    codes = f"Ada; {code}\nBob; {code}\nCy; 2026-11-28-0123456789ab"
    sent = {"set": text, "ask": "lagrangian", "hints": "yes", "codes": codes}
    shown = client.post("/class/marks", data=sent)
    assert [*re.findall(r"(\d) of 2", shown.text)] == ["1", "0", "0"]
    table = client.post("/class/marks", data=sent | {"format": "csv"})
    assert table.headers["content-type"].startswith("text/csv")
    assert list(csv.reader(io.StringIO(table.text)))[1:] == [
        ["Ada", "1", "0", "1"],
        ["Bob", "0", "0", "0"],
        ["Cy", "0", "0", "0"],
    ]


@pytest.mark.slow
def test_pages_of_a_class_say_what_is_wrong_with_a_set(client: httpx.Client) -> None:
    assert "no number" in client.get("/class/new", params={"set": "x'' = [5..1] x"}).text
    assert "at least one line" in client.get("/class").text
    unread = client.get("/class/new", params={"set": "x'' = -x\nx'' = -x @"}).text
    assert "Exercise 2, x" in unread
    assert "/class?" not in unread
    asked = client.post("/class/marks", data={"set": "", "codes": "Ada"})
    assert "at least one line" in asked.text
    script = client.get("/class", params={"set": "x'' = -x", "student": "<script>x</script>"}).text
    assert "<script>x" not in script


def test_a_wrong_answer_is_told_the_equations_that_it_does_not_give() -> None:
    """x'^2/2 - x^2/2 + y'^2/2 has x'' = -x, and y'' = 0 for y'' = -4 y."""
    fields = forms.fields_of_link({"equations": "x'' = -x; y'' = -4*y"})
    assert fields is not None
    fields |= {"lagrangian": "", "constraints": "", "kind": "equations"}
    found = exercises.exercise_task(fields, "lagrangian", "one", "x'^2/2 - x^2/2 + y'^2/2")
    assert found.judged is not None
    assert found.judged.given == {"x": "-x", "y": "0"}
    (missed,) = found.wanted
    assert "<mi>y</mi>" in missed
    assert "<mi>x</mi>" not in missed


def test_the_frame_of_an_exercise_holds_its_link_and_is_as_wide_as_the_page_around_it(
    client: httpx.Client,
) -> None:
    page = client.get("/exercise/new", params={"equations": "x'' = -x"}).text
    (frame,) = re.findall(r"<iframe [^>]*></iframe>", html.unescape(page))
    assert 'width="100%"' in frame
    assert "/exercise?" in frame
