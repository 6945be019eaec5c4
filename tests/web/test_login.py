"""If keys are required, people log in on a page; the cookie acts like the header, and only for our
pages.
"""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from inverse_service.settings import Settings, hash_of_key
from inverse_service.web.application import create_application
from inverse_service.web.clients import COOKIE, LARGEST_KEY

KEY = "a long key with spaces, commas; and \u00fcmlauts"
ADDRESS = "http://service.example"
OUTSIDE = ("cross-site", "same-site")


def ask(*calls: tuple[str, str, dict[str, Any]], keys: bool = True) -> list[httpx.Response]:
    """The responses to calls of one browser, in order; the service needs no workers for them."""

    async def all_of_them() -> list[httpx.Response]:
        chosen = (("alice", hash_of_key(KEY)), ("bob", hash_of_key("other"))) if keys else ()
        transport = httpx.ASGITransport(app=create_application(Settings(api_keys=chosen)))
        async with httpx.AsyncClient(transport=transport, base_url=ADDRESS) as browser:
            return [await browser.request(method, path, **more) for method, path, more in calls]

    return asyncio.run(all_of_them())


def login(key: str = KEY, place: str = "/atlas", **headers: str) -> tuple[str, str, dict[str, Any]]:
    return "POST", "/login", {"data": {"key": key, "next": place}, "headers": headers}


def get(path: str, **headers: str) -> tuple[str, str, dict[str, Any]]:
    return "GET", path, {"headers": headers}


def test_a_page_without_a_key_leads_to_the_form_and_back() -> None:
    page, form, entered, shown = ask(
        get("/atlas?a=b"), get("/login?next=/atlas%3Fa%3Db"), login(), get("/atlas")
    )
    assert (page.status_code, page.headers["location"]) == (303, "/login?next=/atlas%3Fa%3Db")
    assert 'name="next" value="/atlas?a=b"' in form.text
    assert (entered.status_code, entered.headers["location"]) == (303, "/atlas")
    assert shown.status_code == 200
    assert "Log out" in shown.text


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites() -> None:
    [entered] = ask(login())
    cookie = entered.headers["set-cookie"]
    assert cookie.startswith(COOKIE + "=")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert KEY not in cookie


def test_the_cookie_counts_like_the_header_until_it_is_taken_back() -> None:
    before, _, during, _, after = ask(
        get("/v1/catalogue"),
        login(),
        get("/v1/catalogue"),
        ("POST", "/logout", {}),
        get("/v1/catalogue"),
    )
    assert [answer.status_code for answer in (before, during, after)] == [401, 200, 401]


@pytest.mark.slow
@pytest.mark.parametrize("key", ["", "wrong", hash_of_key(KEY), KEY + "x", "x" * (LARGEST_KEY + 1)])
def test_another_key_is_refused_and_sets_no_cookie(key: str) -> None:
    entered, page = ask(login(key), get("/atlas"))
    assert entered.status_code == 401
    assert "set-cookie" not in entered.headers
    assert 'role="alert"' in entered.text
    assert key == "" or key not in entered.text
    assert page.status_code == 303


@pytest.mark.parametrize("value", ["", "x", "%%%", "=" * 9, "A" * 9000])
def test_an_invented_cookie_is_not_a_key(value: str) -> None:
    [answer] = ask(get("/v1/catalogue", cookie=f"{COOKIE}={value}"))
    assert answer.status_code == 401


@pytest.mark.slow
@pytest.mark.parametrize(
    "place", ["//evil.example", "https://evil.example", "/\\evil.example", "", "javascript:f()"]
)
def test_the_way_back_never_leads_elsewhere(place: str) -> None:
    [entered] = ask(login(place=place))
    assert entered.headers["location"] == "/"


@pytest.mark.parametrize("site", OUTSIDE)
def test_forms_of_other_sites_are_refused(site: str) -> None:
    refused = ask(
        login(**{"sec-fetch-site": site}),
        ("POST", "/logout", {"headers": {"sec-fetch-site": site}}),
        ("POST", "/theme", {"data": {"theme": "dark"}, "headers": {"sec-fetch-site": site}}),
    )
    assert [answer.status_code for answer in refused] == [403, 403, 403]


@pytest.mark.parametrize(
    ("origin", "status"),
    [
        ("http://service.example", 303),
        ("http://SERVICE.example:80", 303),
        ("https://evil.example", 403),
        ("null", 403),
    ],
)
def test_a_browser_that_only_tells_the_origin_of_a_page_is_believed(
    origin: str, status: int
) -> None:
    form = {"data": {"theme": "dark"}, "headers": {"origin": origin}}
    theme, page = ask(("POST", "/theme", form), get("/login"))
    assert theme.status_code == status
    assert (
        page.headers["referrer-policy"] == "same-origin"
    )  # otherwise browsers send the origin "null"


@pytest.mark.parametrize("site", OUTSIDE)
def test_the_cookie_does_not_count_where_another_site_sends_a_body(site: str) -> None:
    body: dict[str, Any] = {"json": {}, "headers": {"sec-fetch-site": site}}
    _, from_outside, from_our_page = ask(
        login(), ("POST", "/v1/check", body), ("GET", "/v1/catalogue", {})
    )
    assert from_outside.status_code == 401
    assert from_our_page.status_code == 200


def test_a_script_of_the_page_gets_an_error_instead_of_a_redirect() -> None:
    [answer] = ask(("POST", "/understood?fragment=1", {"headers": {"sec-fetch-mode": "cors"}}))
    assert answer.status_code == 401


def test_without_keys_there_is_nothing_to_log_in_to() -> None:
    page, form = ask(get("/atlas"), get("/login"), keys=False)
    assert page.status_code == 200
    assert "Log out" not in page.text
    assert form.headers["location"] == "/"


def test_colors_are_remembered_and_can_be_given_back_to_the_system() -> None:
    chosen, page, nonsense, again = ask(
        ("POST", "/theme", {"data": {"theme": "dark", "back": "/learn"}}), get("/learn"),
        ("POST", "/theme", {"data": {"theme": "'><script>", "back": "//evil.example"}}), get("/learn"), keys=False,
    )  # fmt: skip
    assert (chosen.status_code, chosen.headers["location"]) == (303, "/learn")
    assert '<html lang="en" data-theme="dark">' in page.text
    assert nonsense.headers["location"] == "/"
    assert '<html lang="en">' in again.text
