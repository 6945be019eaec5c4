"""Keys in a file are rotated without a restart, expire on their day, and survive a typo in the
file.
"""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest
from starlette.requests import Request

from inverse_service.errors import InputError
from inverse_service.settings import Settings, hash_of_key
from inverse_service.web.application import create_application
from inverse_service.web.clients import Keys, note_client, viewer_of
from tests.logs import Logged

DAY = datetime.timedelta(days=1)


def line(client: str, key: str, day: object = "") -> str:
    return f"{client}:{hash_of_key(key)} {day}\n"


def test_keys_change_with_their_file(tmp_path: Path) -> None:
    path = tmp_path / "keys"
    path.write_text("# clients\n" + line("alice", "old") + line("bob", "his"))
    keys = Keys(Settings(api_keys=(("carol", hash_of_key("hers")),), api_keys_file=str(path)))
    assert [keys.client_of(key) for key in ("old", "his", "hers", "new", "")] == [
        "alice",
        "bob",
        "carol",
        None,
        None,
    ]
    path.write_text(line("alice", "old") + line("alice", "new"))
    assert [keys.client_of(key) for key in ("old", "new", "his")] == ["alice", "alice", None]
    path.write_text("")
    assert keys.client_of("new") is None
    assert keys.are_asked
    assert keys.client_of("hers") == "carol"


def test_a_file_that_went_wrong_leaves_the_keys_as_they_were(
    tmp_path: Path, logged: Logged
) -> None:
    path = tmp_path / "keys"
    path.write_text(line("alice", "key"))
    keys = Keys(Settings(api_keys_file=str(path)))
    path.write_text(line("alice", "key") + "nonsense of somebody\n")
    assert keys.client_of("key") == "alice"
    assert "line 2" in logged.text
    path.unlink()
    assert keys.client_of("key") == "alice"
    assert keys.client_of("nonsense of somebody") is None


def test_a_key_counts_up_to_its_last_day(tmp_path: Path) -> None:
    path, today = tmp_path / "keys", datetime.datetime.now(datetime.UTC).date()
    path.write_text(
        line("a", "over", today - DAY) + line("b", "last", today) + line("c", "next", today + DAY)
    )
    keys = Keys(Settings(api_keys_file=str(path)))
    assert [keys.client_of(key) for key in ("over", "last", "next")] == [None, "b", "c"]


@pytest.mark.parametrize("content", ["alice\n", line("alice", "x", "soon"), line("a b", "x"), None])
def test_a_file_that_is_wrong_at_the_start_stops_it(tmp_path: Path, content: str | None) -> None:
    path = tmp_path / "keys"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match="API_KEYS_FILE"):
        Keys(Settings(api_keys_file=str(path)))


@pytest.mark.parametrize(
    ("keys", "listed"), [((("alice", hash_of_key("secret")),), "alice"), ((), None)]
)
def test_where_keys_are_set_a_client_sees_its_own_jobs_alone(
    keys: tuple[tuple[str, str], ...], listed: str | None
) -> None:
    request = Request(
        {
            "type": "http",
            "app": create_application(Settings(api_keys=keys)),
            "headers": [(b"authorization", b"Bearer secret")],
            "client": ("127.0.0.1", 1),
            "state": {},
        }
    )
    note_client(request)
    assert viewer_of(request).listed == listed
