"""Settings come from the environment, and an invalid one is named in one sentence."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from service.settings import SECRET_FILES, Settings, load_settings
from sim.errors import UsageError


@pytest.fixture(autouse=True)
def _clean_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(SECRET_FILES, raising=False)
    for each in fields(Settings):
        monkeypatch.delenv(f"ROBOMARK_{each.name.upper()}", raising=False)


def test_the_home_is_the_users_data_directory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert load_settings().home == tmp_path / "robomark"
    assert load_settings().database == f"sqlite:///{tmp_path}/robomark/robomark.db"


def test_a_child_process_reads_the_same_settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    settings = Settings(home=tmp_path, broker_url="redis://host:1/2", lease_seconds=3.5, concurrency=3)
    for name, value in settings.to_environment().items():
        monkeypatch.setenv(name, value)
    assert load_settings() == settings


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("CONCURRENCY", "0", "greater than or equal to 1"),
        ("CONCURRENCY", "many", "valid integer"),
        ("LEASE_SECONDS", "-3", "greater than or equal to 0.5"),
        ("BROKER_URL", "amqp://host", "redis://"),
        ("DATABASE_URL", "mysql://host/name", "postgresql://"),
        ("DATABASE_URL", "somewhere", "sqlite:///path"),
        ("DATABASE_URL", "sqlite://", "sqlite:///path"),
        ("HOME", "~no-such-user/data", "expected a folder"),
        ("LOG_LEVEL", "loud", "WARNING"),
    ],
)
def test_a_wrong_setting_is_named(monkeypatch: pytest.MonkeyPatch, name: str, value: str, expected: str) -> None:
    monkeypatch.setenv(f"ROBOMARK_{name}", value)
    with pytest.raises(UsageError) as caught:
        load_settings()
    assert str(caught.value).startswith(f"ROBOMARK_{name} is '{value}'")
    assert expected in str(caught.value)


def test_a_user_without_a_home_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.setattr("os.getuid", lambda: 4_000_000)  # as in a container that runs as an unknown user
    with pytest.raises(UsageError, match="set ROBOMARK_HOME"):
        load_settings()


def test_what_the_environment_should_not_show_lies_in_files(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "ROBOMARK_DATABASE_URL").write_text("postgresql+psycopg://robomark:word@host/name\n")
    (tmp_path / "ROBOMARK_CONCURRENCY").write_text("3")
    (tmp_path / "another").write_text("not ours")
    monkeypatch.setenv(SECRET_FILES, str(tmp_path))
    monkeypatch.setenv("ROBOMARK_CONCURRENCY", "4")
    settings = load_settings()
    assert settings.database == "postgresql+psycopg://robomark:word@host/name"
    assert settings.concurrency == 4


def test_secret_files_that_are_not_there_or_wrong_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(SECRET_FILES, str(tmp_path / "nowhere"))
    with pytest.raises(UsageError, match=r"CREDENTIALS_DIRECTORY is '.*nowhere': expected a folder"):
        load_settings()
    (tmp_path / "ROBOMARK_SECRET").write_text("short")
    monkeypatch.setenv(SECRET_FILES, str(tmp_path))
    with pytest.raises(UsageError, match=r"^ROBOMARK_SECRET is not usable: expected at least 16"):
        load_settings()
    (tmp_path / "ROBOMARK_SECRET").unlink()
    (tmp_path / "ROBOMARK_DATABASE_URL").symlink_to("ROBOMARK_DATABASE_URL")
    with pytest.raises(UsageError, match=r"a file in it cannot be read: .*ROBOMARK_DATABASE_URL"):
        load_settings()
