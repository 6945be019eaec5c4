"""What browsers and programs ask for besides pages, and a key of a question however long it waits."""

from __future__ import annotations

import re

import httpx
import pytest


def test_pages_may_be_indexed_and_answers_to_single_questions_may_not(client: httpx.Client) -> None:
    found = client.get("/robots.txt")
    assert found.headers["content-type"].startswith("text/plain")
    lines = found.text.splitlines()
    assert lines[0] == "User-agent: *"
    assert {*lines[1:]} == {"Disallow: /results/", "Disallow: /v1/"}


def test_the_icon_has_the_name_that_browsers_ask_for(client: httpx.Client) -> None:
    found = client.get("/favicon.ico", follow_redirects=True)
    assert found.history[0].status_code == 301
    assert found.headers["content-type"].startswith("image/svg")


@pytest.mark.parametrize(("theme", "age"), [("dark", 365), ("light", 365), ("", 0), ("blue", 0)])
def test_a_theme_is_kept_for_a_year_and_one_that_is_none_is_forgotten(
    client: httpx.Client, theme: str, age: int
) -> None:
    found = client.post("/theme", data={"theme": theme, "back": "/learn"})
    assert (found.status_code, found.headers["location"]) == (303, "/learn")
    cookie = found.headers["set-cookie"]
    name, *rest = [part.strip() for part in cookie.split(";")]
    assert name == (f"theme={theme}" if age else 'theme=""')
    assert f"Max-Age={age * 86400}" in rest
    assert "SameSite=lax" in rest


def test_a_way_back_that_leads_elsewhere_is_not_taken(client: httpx.Client) -> None:
    for back in ("https://example.org/", "//example.org/", "javascript:alert(1)"):
        assert client.post("/theme", data={"back": back}).headers["location"] == "/"


@pytest.mark.parametrize("prefer", ["respond-async", "wait=0", "wait=20"])
def test_a_key_belongs_to_one_question_however_long_it_is_waited_for(
    client: httpx.Client, prefer: str
) -> None:
    headers = {"Idempotency-Key": f"one {prefer}", "Prefer": prefer}
    first = client.post("/v1/solve", json={"equations": "x'' = -x"}, headers=headers)
    again = client.post("/v1/solve", json={"equations": "x'' = -x"}, headers=headers)
    other = client.post("/v1/solve", json={"equations": "x'' = -2*x"}, headers=headers)
    assert {first.status_code, again.status_code} <= {200, 202}
    assert other.status_code == 422
    assert other.json()["type"].rpartition(":")[2] == "idempotency-key"


def test_each_page_of_the_menu_says_which_one_it_is(client: httpx.Client) -> None:
    """By a mark in the menu, and by a title and a heading of its own."""
    menu = re.compile(r'<nav id="pages".*?</nav>', re.S)
    places = re.findall(r'<a href="([^"]+)"', menu.findall(client.get("/").text)[0])
    assert {"/", "/simulate", "/atlas", "/learn"} <= {*places}
    titles = set()
    for place in places:
        page = client.get(place).text
        (found,) = menu.findall(page)
        marked = re.findall(r'<a href="([^"]+)" aria-current="page"', found)
        assert marked == [place]
        titles |= {*re.findall("<title>(.*?)</title>", page, re.S)}
        assert len(re.findall("<h1", page)) == 1
    assert len(titles) == len(places)


@pytest.mark.parametrize("theme", ["dark", "light", ""])
def test_the_chosen_theme_is_that_of_the_page_and_its_button_is_pressed(
    client: httpx.Client, theme: str
) -> None:
    cookie = {"Cookie": f"theme={theme}"} if theme else {}
    page = client.get("/about", headers=cookie).text
    assert re.findall(r'<html lang="en"(?: data-theme="(\w+)")?>', page) == [theme]
    pressed = dict(re.findall(r'<button name="theme" value="(\w*)" aria-pressed="(\w+)"', page))
    assert pressed == {one: str(one == theme).lower() for one in ("light", "dark", "")}


@pytest.mark.parametrize("place", ["/nothing", "/results/none", "/atlas/none"])
def test_a_page_that_is_not_there_says_so_as_a_page(client: httpx.Client, place: str) -> None:
    found = client.get(place, headers={"Accept": "text/html"})
    assert found.status_code == 404
    assert found.headers["content-type"].startswith("text/html")
    assert 'aria-current="page"' not in found.text
