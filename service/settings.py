"""What an operator can set, read once from the environment (``ROBOMARK_...``) and handed down as a frozen value.

What the environment should not show may lie in files instead. Nothing else in Robomark reads the environment; nothing
here opens a connection.
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
from submissions.seeds import PUBLIC, Secret

PREFIX = "ROBOMARK_"
#: A folder with files that are named as settings; it is called so by systemd, too.
SECRET_FILES = "CREDENTIALS_DIRECTORY"
_SHORTEST_SECRET = 16
_READ = "read"
Written = TypeVar("Written", str, Path)


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


def _setting(read: Callable[[Any], Any], **default: Any) -> Any:
    """A setting; ``read`` takes it as it is written or given, and raises ValueError saying what was expected."""
    return field(**default, metadata={_READ: read})


def _folder(written: str | Path) -> Path:
    try:
        return Path(written).expanduser().absolute()
    except RuntimeError:
        raise ValueError("expected a folder; there is no such user's home") from None


def _broker(url: str) -> str:
    if url and url.partition("://")[0] not in {"redis", "rediss", "redis+socket"}:
        raise ValueError("expected redis://host:port/number, rediss://... or redis+socket:///path")
    return url


def _database(url: str) -> str:
    if not url:
        return url
    # Costs more than all else that settings do.
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


def _address(url: str) -> str:
    scheme, _, name = url.rstrip("/").partition("://")
    if url and (scheme not in {"https", "http"} or not name or "/" in name):
        raise ValueError("expected https://name, as browsers are to write it")
    return url.rstrip("/")


def names_in(written: str) -> tuple[str, ...]:
    """The parts of a list with commas."""
    return tuple(part for each in written.split(",") if (part := each.strip().lower()))


def _networks(written: str) -> str:
    for each in names_in(written):
        try:
            ip_network(each)
        except ValueError:
            raise ValueError("expected addresses or networks with commas between, like 127.0.0.1, 10.0.0.0/8") from None
    return ",".join(names_in(written))


def _host_names(written: str) -> str:
    if not all(re.fullmatch(r"[a-z0-9]([a-z0-9._-]*[a-z0-9])?", each) for each in names_in(written)):
        raise ValueError("expected names without ports, with commas between, like web, robomark.internal")
    return ",".join(names_in(written))


def _log_level(level: str) -> str:
    if level.upper() not in {"DEBUG", "INFO", "WARNING", "ERROR"}:
        raise ValueError("expected DEBUG, INFO, WARNING or ERROR")
    return level.upper()


def _secret(given: str | Secret) -> Secret:
    text = given.text if isinstance(given, Secret) else given.strip()
    if 0 < len(text) < _SHORTEST_SECRET:
        raise ValueError(f"expected at least {_SHORTEST_SECRET} characters that nobody can guess")
    return Secret(text)


def _whether(written: str | bool) -> bool:
    known = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
    if str(written).lower() not in known:
        raise ValueError("expected true or false")
    return known[str(written).lower()]


def _seconds(least: float, most: float) -> Callable[[Any], float]:
    def read(written: str | float) -> float:
        try:
            number = float(written)
        except ValueError:
            raise ValueError("input should be a valid number, unable to parse string as a number") from None
        return _between(least, number, most)

    return read


def _count(least: int, most: int) -> Callable[[Any], int]:
    def read(written: str | int) -> int:
        try:
            number = int(written)
        except ValueError:
            raise ValueError("input should be a valid integer, unable to parse string as an integer") from None
        return int(_between(least, number, most))

    return read


def _between(least: float, number: float, most: float) -> float:
    if not number >= least:
        raise ValueError(f"input should be greater than or equal to {least}")
    if number > most:
        raise ValueError(f"input should be less than or equal to {most}")
    return number


@dataclass(frozen=True)
class Settings:
    """All settings. An empty ``broker_url`` means the bundled server, an empty ``database_url`` SQLite in ``home``.

    Raises UsageError: naming the variable, its value and what was expected.
    """

    home: Path = field(default_factory=default_home, metadata={_READ: _folder})
    broker_url: str = _setting(_broker, default="")
    database_url: str = _setting(_database, default="")
    concurrency: int = _setting(_count(1, 256), default_factory=lambda: len(os.sched_getaffinity(0)))
    #: A worker that has not been heard of for this long has lost its job.
    lease_seconds: float = _setting(_seconds(0.5, 3600), default=60.0)
    #: How often a job is begun, at most, when machines fail under it.
    max_attempts: int = _setting(_count(1, 20), default=3)
    #: The wait before a second attempt; it doubles with each further one.
    backoff_seconds: float = _setting(_seconds(0, 3600), default=5.0)
    #: How long one whole job may take in real time: the backstop behind all other limits.
    job_seconds: float = _setting(_seconds(1, 86_400), default=900.0)
    #: How often each process of a worker grades the known answer.
    self_test_seconds: float = _setting(_seconds(1, 86_400), default=300.0)
    #: A queued job whose notice is older than this may be notified again.
    notify_seconds: float = _setting(_seconds(0.1, 3600), default=10.0)
    #: What the processes of one grading may take together, where a worker has control groups; more where the
    #: assignment allows them more.
    slot_memory_mb: int = _setting(_count(256, 1_000_000), default=1536)
    log_level: str = _setting(_log_level, default="WARNING")
    #: Where browsers find the web server, when others than this machine are to reach it.
    public_url: str = _setting(_address, default="")
    #: How often a token may call the API; as often again at once, after a rest.
    api_calls_per_minute: float = _setting(_seconds(1, 1_000_000), default=600.0)
    #: What all submissions of one student to one assignment may have together.
    student_quota_mb: int = _setting(_count(1, 1_000_000), default=200)
    #: Proxies whose X-Forwarded-For is believed: addresses or networks, with commas between.
    trusted_proxies: str = _setting(_networks, default="")
    #: Names by which /health and /metrics answer besides addresses and the public name, with commas between.
    probe_hosts: str = _setting(_host_names, default="")
    #: Whether webhooks may lead to addresses of the own network, which else are refused.
    webhooks_inside: bool = _setting(_whether, default=False)
    #: Wins over the database's own; empty where there is none.
    secret: Secret = field(default=PUBLIC, metadata={_READ: _secret})

    def __post_init__(self) -> None:
        for each in fields(self):
            given = getattr(self, each.name)
            try:
                object.__setattr__(self, each.name, each.metadata[_READ](given))
            except ValueError as error:
                shown = "not usable" if each.name == "secret" else repr(given)
                raise UsageError(f"{_variable(each.name)} is {shown}: {error}") from None

    @property
    def own_secret(self) -> Secret | None:
        """What the environment has in place of the database's secret."""
        return None if self.secret == PUBLIC else self.secret

    @property
    def database(self) -> str:
        """The URL of the database in use."""
        return self.database_url or f"sqlite:///{self.home / 'robomark.db'}"

    def with_broker(self, url: str) -> Self:
        """The same settings, with a broker that is known to be there."""
        return replace(self, broker_url=url)

    def environment(self) -> dict[str, str]:
        """The variables that make a child process read these same settings; but the secret, which it inherits."""
        told = {name: str(value) for name, value in asdict(self).items() if name != "secret"}
        return {_variable(name): text for name, text in told.items() if text}


def load_settings(**overrides: object) -> Settings:
    """Settings from the environment, else from secret files; ``overrides`` win.

    Raises:
        UsageError: naming the variable, its value and what was expected.
    """
    folder = os.environ.get(SECRET_FILES) or None
    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"{SECRET_FILES} is {folder!r}: expected a folder with files named as the settings")
    written = ({} if folder is None else _in_files(Path(folder))) | _of_settings(os.environ)
    return Settings(**(written | overrides))  # type: ignore[arg-type]


def _in_files(folder: Path) -> dict[str, str]:
    try:
        paths = _of_settings({path.name: path for path in folder.iterdir()})
        texts = {name: path.read_text().strip() for name, path in paths.items()}
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{SECRET_FILES}: a file in it cannot be read: {error}") from None
    return {name: text for name, text in texts.items() if text}


def _of_settings(named: Mapping[str, Written]) -> dict[str, Written]:
    """What there is for settings; nothing is said by a variable that is empty."""
    variables = {_variable(each.name): each.name for each in fields(Settings)}
    return {variables[name.upper()]: found for name, found in named.items() if name.upper() in variables and found}


def _variable(name: str) -> str:
    return f"{PREFIX}{name.upper()}"
