"""What a teacher and a researcher hand on: exercises, frames, comparisons, the search, one's own questions, batches."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, expect

from tests.conftest import running_service

from .conftest import Look, Visit, new_page, whole


def test_other_sites_frame_an_answer_only_where_they_are_listed(visit: Visit) -> None:
    visit.go("/?equations=x''+%3D+-3*x")
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.locator("#verdict").first).to_be_visible()
    whole(visit.page)
    answer = httpx.get(visit.page.url + "/embed", timeout=30)
    assert "frame-ancestors 'self'" in answer.headers["content-security-policy"]
    assert "<nav" not in answer.text
    assert "frame-ancestors 'none'" in httpx.get(visit.page.url, timeout=30).headers["content-security-policy"]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, *words: object) -> None:
        """Nothing."""


@pytest.fixture
def courses(tmp_path: Path) -> Iterator[list[str]]:
    """The origins of two other sites that serve the same folder."""
    sites = [ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path))) for _ in range(2)]
    for site in sites:
        threading.Thread(target=site.serve_forever, daemon=True).start()
    yield [f"http://127.0.0.1:{site.server_port}" for site in sites]
    for site in sites:
        site.shutdown()
        site.server_close()


@pytest.mark.slow
def test_a_browser_frames_an_answer_on_a_listed_origin_and_on_no_other(
    browser: Browser, courses: list[str], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    listed, other = courses
    page = new_page(browser, Look())
    for address in running_service(tmp_path_factory.mktemp("framed"), 60, frame_origins=listed):
        page.goto(address + "/?equations=x''+%3D+-3*x")
        page.get_by_role("button", name="Open the answer").click()
        expect(page.locator("#verdict").first).to_be_visible(timeout=60_000)
        whole(page)
        result = page.url
        (tmp_path / "course.html").write_text(f'<iframe src="{result}/embed"></iframe>')
        (tmp_path / "whole.html").write_text(f'<iframe src="{result}"></iframe>')
        page.goto(f"{listed}/course.html")
        expect(page.frame_locator("iframe").locator(".formula").first).to_be_visible()
        for refused in (f"{other}/course.html", f"{listed}/whole.html"):
            with page.expect_console_message(lambda message: "frame-ancestors" in message.text):
                page.goto(refused)
    page.context.close()


def test_plain_equations_are_a_batch_and_its_table_is_csv(visit: Visit) -> None:
    visit.go("/batch")
    visit.page.get_by_label("Or type the lines").fill("x'' = -x - c*x'\nx'' = -y'; y'' = -y\nx'' = @")
    visit.page.get_by_role("button", name="Solve all").click()
    expect(visit.page.locator("main")).to_contain_text("3 of 3")
    table = visit.page.request.get(visit.page.url + "/results.csv").text().splitlines()
    assert table[0] == "line,name,verdict,lagrangian or reason,checked,where"
    assert [row.split(",")[0] for row in table[1:]] == ["1", "2", "3"]
    assert "variational,exp(c*t)*(x'^2 - x^2)/2," in table[1]
    assert "not_variational" in table[2]
    assert "failed" in table[3]


@pytest.mark.slow
def test_a_reading_that_was_meant_is_put_into_the_field(visit: Visit) -> None:
    visit.go("/")
    typed = visit.page.get_by_label("Equations", exact=True)
    typed.fill("x'' = -k/m x\ny'' = -y")
    visit.page.get_by_role("button", name="x'' = -(k/m)*x", exact=True).click()
    expect(typed).to_have_value("x'' = -(k/m)*x\ny'' = -y")
    expect(visit.page.locator("#understood .reading")).to_contain_text("constants")
    assert visit.page.url == visit.address + "/"
