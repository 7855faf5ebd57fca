"""The tables: made once whoever comes first, the same as the models say, and never taken down."""

from __future__ import annotations

import multiprocessing

import pytest
from alembic import command
from sqlalchemy import inspect, text

from service.settings import Settings
from service.store.engine import open_engine, open_store
from service.store.migrate import configuration, current_revision, newest_revision
from service.store.models import Base
from sim.errors import HostError


def _open(settings: Settings) -> None:
    open_store(settings).close()


def test_the_migrations_make_what_the_models_say(service_settings: Settings) -> None:
    with open_store(service_settings) as store:
        assert current_revision(store.engine) == newest_revision()
        assert set(inspect(store.engine).get_table_names()) == {*Base.metadata.tables, "alembic_version"}
        with store.engine.begin() as connection:
            command.check(configuration(connection))


def test_many_may_come_first(service_settings: Settings) -> None:
    spawned = multiprocessing.get_context("spawn")
    processes = [spawned.Process(target=_open, args=(service_settings,)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
        assert process.exitcode == 0
        process.close()
    engine = open_engine(service_settings.database)
    assert current_revision(engine) == newest_revision()
    engine.dispose()


def test_a_newer_database_is_refused(service_settings: Settings) -> None:
    with open_store(service_settings) as store, store.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(HostError, match=r"newer Robomark .*no way down"):
        open_store(service_settings)


def test_a_database_that_is_away_is_named_without_its_password(service_settings: Settings) -> None:
    url = "postgresql+psycopg://someone:hush@127.0.0.1:1/nowhere"
    with pytest.raises(HostError) as caught:
        open_store(service_settings.model_copy(update={"database_url": url}))
    assert "127.0.0.1" in str(caught.value)
    assert "hush" not in str(caught.value)
