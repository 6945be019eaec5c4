"""Settings come from the environment; a bad value gets one sentence that names the variable."""

from __future__ import annotations

import pytest

from inverse_service.errors import InputError
from inverse_service.settings import read_settings


def test_an_empty_environment_gives_the_defaults() -> None:
    settings = read_settings({})
    assert (settings.time_limit, settings.memory_limit, settings.cors_origins) == (60.0, 4096, ())
    assert settings.workers >= 1


def test_values_are_read() -> None:
    environment = {
        "INVERSE_SERVICE_WORKERS": " 3 ",
        "INVERSE_SERVICE_TIME_LIMIT": "2.5",
        "INVERSE_SERVICE_CORS_ORIGINS": "https://a.example, https://b.example",
    }
    settings = read_settings(environment)
    assert (settings.workers, settings.time_limit) == (3, 2.5)
    assert settings.cors_origins == ("https://a.example", "https://b.example")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("WORKERS", "0"), ("WORKERS", "two"), ("WORKERS", "-1"), ("WORKERS", "9" * 5000), ("WORKERS", "\u0663"),
        ("TIME_LIMIT", "nan"), ("TIME_LIMIT", "inf"), ("TIME_LIMIT", "0"), ("TIME_LIMIT", "soon"),
        ("MEMORY_LIMIT", "1"), ("MAX_BODY", "1.5"), ("QUEUE", ""), ("CORS_ORIGINS", "example"),
    ],
)  # fmt: skip
def test_a_bad_value_names_its_variable(name: str, value: str) -> None:
    if not value:
        assert read_settings({"INVERSE_SERVICE_" + name: value}) == read_settings({})
        return
    with pytest.raises(InputError, match=f"INVERSE_SERVICE_{name}"):
        read_settings({"INVERSE_SERVICE_" + name: value})


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("API_KEY", "INVERSE_SERVICE_API_KEYS"), ("TIMELIMIT", "INVERSE_SERVICE_TIME_LIMIT"), ("WORKER", "WORKERS"),
        ("ZZZZZZ", "settings.md"),
    ],
)  # fmt: skip
def test_a_misspelt_setting_stops_the_start(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_settings({f"INVERSE_SERVICE_{name}": "1"})


@pytest.mark.parametrize("value", ["", " , ", "alice", "alice:123", ":" + "g" * 64])
def test_keys_that_are_none_stop_the_start(value: str) -> None:
    with pytest.raises(InputError, match="SHA-256"):
        read_settings({"INVERSE_SERVICE_API_KEYS": value})
