"""The state of Robomark in one kernel: the engine, the simulator's page, and the seed."""

from __future__ import annotations

import contextlib
import importlib
import os
from typing import cast

from robomark_notebook.engine import Answerer, Engine, EngineError, MagicCall, MagicResult, Page

#: Environment variables with the address and the token of a server, for example set by a JupyterHub.
URL_VARIABLE, TOKEN_VARIABLE = "ROBOMARK_URL", "ROBOMARK_TOKEN"


class Session:
    """The engine of a kernel with its state between magics."""

    def __init__(self) -> None:
        self.seed = 0
        #: The address of the server; empty for the local engine.
        self.url = os.environ.get(URL_VARIABLE, "") if os.environ.get(TOKEN_VARIABLE) else ""
        self._token = os.environ.get(TOKEN_VARIABLE, "")
        self._page: Page | None = None
        self._engine: Engine | None = None
        if not self.url:
            # It starts ahead, so that the first robot does not wait for it. Whoever uses it learns what is wrong.
            with contextlib.suppress(EngineError):
                self._engine = create_local_engine()

    @property
    def engine(self) -> Engine:
        """The engine, with the session's seed.

        Raises:
            EngineError: It cannot be started.
        """
        if self._engine is None:
            self._engine = _create_engine(self.url, self._token)
        self._engine.seed = self.seed
        return self._engine

    def connect(self, url: str, token: str) -> None:
        """Use a server from now on, with a new simulator.

        Raises:
            EngineError: The server cannot be used. The session stays as it was.
        """
        if not token.strip():
            raise EngineError("The token is empty. Create one on the server, on the page of your account.")
        self._change_engine(url, token.strip())

    def use_local(self) -> None:
        """Use the command ``robomark`` on this machine from now on, with a new simulator.

        Raises:
            EngineError: There is no such command. The session stays as it was.
        """
        self._change_engine("", "")

    def call_magic(self, call: MagicCall, answer: Answerer) -> MagicResult:
        """Call a magic of the simulator, and keep the simulator's new page.

        Raises:
            EngineError: A flag is wrong, or the engine failed.
        """
        result = self.engine.call_magic(call, self._page, answer)
        self._page = result.page
        return result

    def close(self) -> None:
        """End the engine, and forget the simulator's page."""
        engine, self._engine, self._page = self._engine, None, None
        if engine is not None:
            engine.close()

    def _change_engine(self, url: str, token: str) -> None:
        engine = _create_engine(url, token)
        self.close()
        self.url, self._token, self._engine = url, token, engine


def _create_engine(url: str, token: str) -> Engine:
    return create_server_engine(url, token) if url else create_local_engine()


# Only the chosen engine's module is imported: the server's takes a while.


def create_local_engine() -> Engine:
    """Start the command ``robomark`` on this machine. Raises EngineError if there is none."""
    return cast(Engine, importlib.import_module("robomark_notebook.local_engine").LocalEngine())


def create_server_engine(url: str, token: str) -> Engine:
    """Return the engine of a server."""
    return cast(Engine, importlib.import_module("robomark_notebook.server_engine").ServerEngine(url, token))
