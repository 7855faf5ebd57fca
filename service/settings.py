"""What an operator can set, read once from the environment (``ROBOMARK_...``) and handed down as a frozen value.

What the environment should not show may lie in files instead. Nothing else in Robomark reads the environment; nothing
here opens a connection.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Self

from pydantic import Field, SecretStr, ValidationError, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict
from pydantic_settings.exceptions import SettingsError

from sim.errors import UsageError
from submissions.seeds import Secret

PREFIX = "ROBOMARK_"
#: A folder with files that are named as settings; it is called so by systemd, too.
SECRET_FILES = "CREDENTIALS_DIRECTORY"
_SHORTEST_SECRET = 16


def default_home() -> Path:
    """The user's data directory, as the XDG base directory specification has it."""
    data = os.environ.get("XDG_DATA_HOME", "")
    try:
        base = Path(data) if data.startswith("/") else Path.home() / ".local" / "share"
    except RuntimeError:
        raise UsageError(
            "this user has no home folder: set ROBOMARK_HOME to one where Robomark may keep its data"
        ) from None
    return base / "robomark"


class Settings(BaseSettings):
    """All settings. An empty ``broker_url`` means the bundled server, an empty ``database_url`` SQLite in ``home``."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, env_ignore_empty=True, frozen=True, extra="forbid")

    home: Path = Field(default_factory=default_home)
    broker_url: str = ""
    database_url: str = ""
    concurrency: int = Field(default_factory=lambda: len(os.sched_getaffinity(0)), ge=1, le=256)
    #: A worker that has not been heard of for this long has lost its job.
    lease_seconds: float = Field(default=60.0, ge=0.5, le=3600)
    #: How often a job is begun, at most, when machines fail under it.
    max_attempts: int = Field(default=3, ge=1, le=20)
    #: The wait before a second attempt; it doubles with each further one.
    backoff_seconds: float = Field(default=5.0, ge=0, le=3600)
    #: How long one whole job may take in real time: the backstop behind all other limits.
    job_seconds: float = Field(default=900.0, ge=1, le=86_400)
    #: How often each process of a worker grades the known answer.
    self_test_seconds: float = Field(default=300.0, ge=1, le=86_400)
    #: A queued job whose notice is older than this may be notified again.
    notify_seconds: float = Field(default=10.0, ge=0.1, le=3600)
    #: What the processes of one grading may take together, where a worker has control groups; more where the
    #: assignment allows them more.
    slot_memory_mb: int = Field(default=1536, ge=256, le=1_000_000)
    log_level: str = "WARNING"
    #: Where browsers find the web server, when others than this machine are to reach it.
    public_url: str = ""
    #: How often a token may call the API; as often again at once, after a rest.
    api_calls_per_minute: float = Field(default=600.0, ge=1, le=1_000_000)
    #: Whether webhooks may lead to addresses of the own network, which else are refused.
    webhooks_inside: bool = False
    #: Wins over the database's own; empty where there is none.
    secret: SecretStr = SecretStr("")

    @field_validator("home")
    @classmethod
    def _absolute(cls, home: Path) -> Path:
        try:
            return home.expanduser().absolute()
        except RuntimeError:
            raise ValueError("expected a folder; there is no such user's home") from None

    @field_validator("broker_url")
    @classmethod
    def _known_broker(cls, url: str) -> str:
        if url and url.partition("://")[0] not in {"redis", "rediss", "redis+socket"}:
            raise ValueError("expected redis://host:port/number, rediss://... or redis+socket:///path")
        return url

    @field_validator("database_url")
    @classmethod
    def _known_database(cls, url: str) -> str:
        if not url:
            return url
        # Costs as much as all else that settings do.
        from sqlalchemy.engine import make_url
        from sqlalchemy.exc import ArgumentError

        try:
            parsed = make_url(url)
            kind = parsed.get_backend_name()
        except ArgumentError as error:
            raise ValueError("expected sqlite:///path or postgresql://user@host/name") from error
        in_memory = kind == "sqlite" and parsed.database in (None, "", ":memory:")
        if kind not in {"sqlite", "postgresql"} or in_memory:
            raise ValueError("expected sqlite:///path or postgresql://user@host/name")
        return url

    @field_validator("public_url")
    @classmethod
    def _whole_address(cls, url: str) -> str:
        scheme, _, rest = url.partition("://")
        if url and (scheme not in {"https", "http"} or not rest.rstrip("/") or "/" in rest.rstrip("/")):
            raise ValueError("expected https://name, as browsers are to write it")
        return url.rstrip("/")

    @field_validator("log_level")
    @classmethod
    def _known_level(cls, level: str) -> str:
        if level.upper() not in {"DEBUG", "INFO", "WARNING", "ERROR"}:
            raise ValueError("expected DEBUG, INFO, WARNING or ERROR")
        return level.upper()

    @field_validator("secret")
    @classmethod
    def _long_enough(cls, secret: SecretStr) -> SecretStr:
        text = secret.get_secret_value().strip()
        if 0 < len(text) < _SHORTEST_SECRET:
            raise ValueError(f"expected at least {_SHORTEST_SECRET} characters that nobody can guess")
        return SecretStr(text)

    @property
    def own_secret(self) -> Secret | None:
        """What the environment has in place of the database's secret."""
        text = self.secret.get_secret_value()
        return Secret(text) if text else None

    @property
    def database(self) -> str:
        """The URL of the database in use."""
        return self.database_url or f"sqlite:///{self.home / 'robomark.db'}"

    def with_broker(self, url: str) -> Self:
        """The same settings, with a broker that is known to be there."""
        return self.model_copy(update={"broker_url": url})

    def environment(self) -> dict[str, str]:
        """The variables that make a child process read these same settings; but the secret, which it inherits."""
        told = self.model_dump(exclude={"secret"})
        return {f"{PREFIX}{name.upper()}": str(value) for name, value in told.items() if value != ""}


def load_settings(**overrides: object) -> Settings:
    """Settings from the environment, else from secret files; ``overrides`` win.

    Raises:
        UsageError: naming the variable, its value and what was expected.
    """
    folder = os.environ.get(SECRET_FILES) or None
    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"{SECRET_FILES} is {folder!r}: expected a folder with files named as the settings")
    try:
        return Settings(_secrets_dir=folder, **overrides)  # type: ignore[arg-type, call-arg]
    except SettingsError as error:
        raise UsageError(f"{SECRET_FILES}: a file in it cannot be read: {error.__cause__ or error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"]).upper()
        message = first["msg"].removeprefix("Value error, ")
        shown = "not usable" if name == "SECRET" else repr(first["input"])
        raise UsageError(f"{PREFIX}{name} is {shown}: {message[:1].lower()}{message[1:]}") from None
