"""Settings of an installation, read once from the environment (``ROBOMARK_...``) into a frozen value.

Confidential settings can be stored in files instead. No other module reads settings from the environment, and this one
opens no connection.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from ipaddress import ip_network
from pathlib import Path
from typing import Any, Self, TypeVar

from sim.errors import UsageError
from submissions.seeds import PUBLIC_SECRET, Secret

PREFIX = "ROBOMARK_"
#: Variable with a folder whose files are named after settings; systemd uses the same name.
SECRET_FILES = "CREDENTIALS_DIRECTORY"
_MIN_SECRET_LENGTH = 16
_PARSER = "read"
Written = TypeVar("Written", str, Path)


def default_home() -> Path:
    """Return the user's data directory, according to the XDG base directory specification."""
    data = os.environ.get("XDG_DATA_HOME", "")
    try:
        base = Path(data) if data.startswith("/") else Path.home() / ".local" / "share"
    except RuntimeError:
        raise UsageError("this user has no home folder: set ROBOMARK_HOME to a folder for Robomark's data") from None
    return base / "robomark"


def _define_setting(read: Callable[[Any], Any], **default: Any) -> Any:
    """Define a setting; ``read`` converts the written or given value and raises ValueError with the expected form."""
    return field(**default, metadata={_PARSER: read})


def _parse_folder(value: str | Path) -> Path:
    try:
        return Path(value).expanduser().absolute()
    except RuntimeError:
        raise ValueError("expected a folder; this user has no home folder") from None


def _parse_broker_url(url: str) -> str:
    if url and url.partition("://")[0] not in {"redis", "rediss", "redis+socket"}:
        raise ValueError("expected redis://host:port/number, rediss://... or redis+socket:///path")
    return url


def _parse_database_url(url: str) -> str:
    if not url:
        return url
    # Imported here, because it takes longer than everything else in the settings.
    from sqlalchemy.engine import make_url
    from sqlalchemy.exc import ArgumentError

    try:
        parsed_url = make_url(url)
        kind = parsed_url.get_backend_name()
    except ArgumentError as error:
        raise ValueError("expected sqlite:///path or postgresql://user@host/name") from error
    is_in_memory = kind == "sqlite" and parsed_url.database in (None, "", ":memory:")
    if kind not in {"sqlite", "postgresql"} or is_in_memory:
        raise ValueError("expected sqlite:///path or postgresql://user@host/name")
    return url


def _parse_address(url: str) -> str:
    scheme, _, name = url.rstrip("/").partition("://")
    if url and (scheme not in {"https", "http"} or not name or "/" in name):
        raise ValueError("expected https://name, as in the browser's address bar")
    return url.rstrip("/")


def split_names(value: str) -> tuple[str, ...]:
    """Split a comma-separated list."""
    return tuple(part for each in value.split(",") if (part := each.strip().lower()))


def _parse_networks(value: str) -> str:
    for network in split_names(value):
        try:
            ip_network(network)
        except ValueError:
            raise ValueError("expected addresses or networks with commas between, like 127.0.0.1, 10.0.0.0/8") from None
    return ",".join(split_names(value))


def _parse_host_names(value: str) -> str:
    if not all(re.fullmatch(r"[a-z0-9]([a-z0-9._-]*[a-z0-9])?", each) for each in split_names(value)):
        raise ValueError("expected names without ports, with commas between, like web, robomark.internal")
    return ",".join(split_names(value))


def _parse_log_level(level: str) -> str:
    if level.upper() not in {"DEBUG", "INFO", "WARNING", "ERROR"}:
        raise ValueError("expected DEBUG, INFO, WARNING or ERROR")
    return level.upper()


def _parse_secret(value: str | Secret) -> Secret:
    text = value.text if isinstance(value, Secret) else value.strip()
    if 0 < len(text) < _MIN_SECRET_LENGTH:
        raise ValueError(f"expected at least {_MIN_SECRET_LENGTH} characters that are hard to guess")
    return Secret(text)


def _parse_boolean(value: str | bool) -> bool:
    booleans = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
    if str(value).lower() not in booleans:
        raise ValueError("expected true or false")
    return booleans[str(value).lower()]


def _build_seconds_parser(minimum: float, maximum: float) -> Callable[[Any], float]:
    def read(value: str | float) -> float:
        try:
            number = float(value)
        except ValueError:
            raise ValueError("input should be a valid number, unable to parse string as a number") from None
        return _check_range(minimum, number, maximum)

    return read


def _build_count_parser(minimum: int, maximum: int) -> Callable[[Any], int]:
    def read(value: str | int) -> int:
        try:
            number = int(value)
        except ValueError:
            raise ValueError("input should be a valid integer, unable to parse string as an integer") from None
        return int(_check_range(minimum, number, maximum))

    return read


def _check_range(minimum: float, number: float, maximum: float) -> float:
    if not number >= minimum:
        raise ValueError(f"input should be greater than or equal to {minimum}")
    if number > maximum:
        raise ValueError(f"input should be less than or equal to {maximum}")
    return number


@dataclass(frozen=True)
class Settings:
    """All settings. An empty ``broker_url`` means the bundled server, an empty ``database_url`` SQLite in ``home``.

    Raises:
        UsageError: A value is invalid; names the variable, its value and the expected form.
    """

    home: Path = field(default_factory=default_home, metadata={_PARSER: _parse_folder})
    broker_url: str = _define_setting(_parse_broker_url, default="")
    database_url: str = _define_setting(_parse_database_url, default="")
    concurrency: int = _define_setting(
        _build_count_parser(1, 256), default_factory=lambda: len(os.sched_getaffinity(0))
    )
    #: A worker that has not been seen for this long loses its job.
    lease_seconds: float = _define_setting(_build_seconds_parser(0.5, 3600), default=60.0)
    #: Maximum number of attempts of a job after host faults.
    max_attempts: int = _define_setting(_build_count_parser(1, 20), default=3)
    #: Delay before the second attempt; doubles with each further one.
    backoff_seconds: float = _define_setting(_build_seconds_parser(0, 3600), default=5.0)
    #: Time limit for one whole job in real time, in addition to all other limits.
    job_seconds: float = _define_setting(_build_seconds_parser(1, 86_400), default=900.0)
    #: Search for the causes of lost marks when a worker has no other work.
    search_causes: bool = _define_setting(_parse_boolean, default=True)
    #: Interval between self-tests of each process of a worker.
    self_test_seconds: float = _define_setting(_build_seconds_parser(1, 86_400), default=300.0)
    #: Age after which the notification of a queued job may be repeated.
    notify_seconds: float = _define_setting(_build_seconds_parser(0.1, 3600), default=10.0)
    #: Memory limit for all processes of one grading, if the worker has control groups; an assignment can raise it.
    slot_memory_mb: int = _define_setting(_build_count_parser(256, 1_000_000), default=1536)
    log_level: str = _define_setting(_parse_log_level, default="WARNING")
    #: Public address of the web server, if it is reachable from other machines.
    public_url: str = _define_setting(_parse_address, default="")
    #: Limit of API calls per token; bursts of the same size are allowed after a pause.
    api_calls_per_minute: float = _define_setting(_build_seconds_parser(1, 1_000_000), default=600.0)
    #: Maximum total size of one student's submissions to one assignment.
    student_quota_mb: int = _define_setting(_build_count_parser(1, 1_000_000), default=200)
    #: Proxies whose X-Forwarded-For header is trusted: comma-separated addresses or networks.
    trusted_proxies: str = _define_setting(_parse_networks, default="")
    #: Comma-separated host names for /health and /metrics, in addition to addresses and the public name.
    probe_hosts: str = _define_setting(_parse_host_names, default="")
    #: Permit webhooks to private networks, which are rejected otherwise.
    webhooks_inside: bool = _define_setting(_parse_boolean, default=False)
    #: Overrides the database's secret; empty for none.
    secret: Secret = field(default=PUBLIC_SECRET, metadata={_PARSER: _parse_secret})

    def __post_init__(self) -> None:
        for setting in fields(self):
            value = getattr(self, setting.name)
            try:
                object.__setattr__(self, setting.name, setting.metadata[_PARSER](value))
            except ValueError as error:
                value_text = "not usable" if setting.name == "secret" else repr(value)
                raise UsageError(f"{_format_variable(setting.name)} is {value_text}: {error}") from None

    @property
    def own_secret(self) -> Secret | None:
        """The secret of the environment, which overrides the database's; None if there is none."""
        return None if self.secret == PUBLIC_SECRET else self.secret

    @property
    def database(self) -> str:
        """The URL of the database in use."""
        return self.database_url or f"sqlite:///{self.home / 'robomark.db'}"

    def with_broker(self, url: str) -> Self:
        """Return the same settings with the address of a running broker."""
        return replace(self, broker_url=url)

    def to_environment(self) -> dict[str, str]:
        """Return the variables that give a child process the same settings, except the secret, which it inherits."""
        texts = {name: str(value) for name, value in asdict(self).items() if name != "secret"}
        return {_format_variable(name): text for name, text in texts.items() if text}


def load_settings(**overrides: object) -> Settings:
    """Load settings from the environment, otherwise from secret files; ``overrides`` take precedence.

    Raises:
        UsageError: A value is invalid; names the variable, its value and the expected form.
    """
    folder = os.environ.get(SECRET_FILES) or None
    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"{SECRET_FILES} is {folder!r}: expected a folder with a file for each setting")
    values = ({} if folder is None else _read_secret_files(Path(folder))) | _filter_settings(os.environ)
    return Settings(**(values | overrides))  # type: ignore[arg-type]


def _read_secret_files(folder: Path) -> dict[str, str]:
    try:
        paths = _filter_settings({path.name: path for path in folder.iterdir()})
        texts = {name: path.read_text().strip() for name, path in paths.items()}
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{SECRET_FILES}: a file in it cannot be read: {error}") from None
    return {name: text for name, text in texts.items() if text}


def _filter_settings(raw_values: Mapping[str, Written]) -> dict[str, Written]:
    """Return the values that belong to settings, skipping empty ones."""
    variables = {_format_variable(each.name): each.name for each in fields(Settings)}
    return {variables[name.upper()]: found for name, found in raw_values.items() if name.upper() in variables and found}


def _format_variable(name: str) -> str:
    return f"{PREFIX}{name.upper()}"
