"""The magics: those of RoboLab's simulator, with its flags, and ``%robomark``.

A mistake by the caller is shown as one sentence, as IPython shows its own usage errors.
"""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Iterator
from typing import Any

from IPython.core.error import UsageError
from IPython.core.magic import Magics, line_cell_magic, line_magic, magics_class

from robomark_notebook import outputs
from robomark_notebook.commands import run_command
from robomark_notebook.engine import EngineError, MagicCall
from robomark_notebook.kernel_responder import KernelResponder
from robomark_notebook.session import Session


def register_magics(shell: Any, *, has_simulator: bool) -> None:
    """Register the magics with a shell, once: their session lasts as long as the kernel.

    Those of the simulator are left out if the shell has another simulator.
    """
    if RobomarkMagics.__name__ in shell.magics_manager.registry:
        return
    session = Session()
    shell.register_magics(RobomarkMagics(shell, session))
    if not has_simulator:
        shell.register_magics(SimulatorMagics(shell, session))


@magics_class
class RobomarkMagics(Magics):
    """``%robomark``."""

    def __init__(self, shell: Any, session: Session) -> None:
        super().__init__(shell)
        self._shell = shell
        self._session = session

    @line_magic
    def robomark(self, line: str) -> None:
        """Show the state, or run a command: ``%robomark help`` lists them."""
        with _usage_errors():
            run_command(self._session, line, self._shell.user_ns)


@magics_class
class SimulatorMagics(Magics):
    """The magics of RoboLab's simulator."""

    def __init__(self, shell: Any, session: Session) -> None:
        super().__init__(shell)
        self._shell = shell
        self._session = session

    @line_cell_magic
    def sim_magic(self, line: str, cell: str | None = None) -> None:
        """Change the simulator with flags, or run a robot program that imports everything itself."""
        self._call_simulator("sim_magic", line, cell)

    @line_cell_magic
    def sim_magic_imports(self, line: str, cell: str | None = None) -> None:
        """Run a robot program for which the usual imports are done."""
        self._call_simulator("sim_magic_imports", line, cell)

    @line_cell_magic
    def sim_magic_preloaded(self, line: str, cell: str | None = None) -> None:
        """Run a robot program for which the usual imports are done, and motors and sensors are set up."""
        self._call_simulator("sim_magic_preloaded", line, cell)

    @line_magic
    def sim_data(self, line: str) -> Any:
        """Return what the robots have logged, as a data frame. ``--clear`` empties the log."""
        return self._call_data_magic("sim_data", line)

    @line_magic
    def sim_robot_state(self, line: str) -> Any:
        """Return the state of the robot as the last run has left it."""
        return self._call_data_magic("sim_robot_state", line)

    @line_magic
    def sim_bw_image_data(self, line: str) -> Any:
        """Return a logged image in black and white."""
        return self._call_data_magic("sim_bw_image_data", line)

    @line_magic
    def sim_image_pair(self, line: str) -> Any:
        """Return the left and the right image of a logged pair."""
        return self._call_data_magic("sim_image_pair", line)

    def _call_simulator(self, name: str, line: str, cell: str | None) -> None:
        from nbev3devsim.load_nbev3devwidget import roboSim

        responder = KernelResponder(self._shell, roboSim)
        with _usage_errors():
            # Releases of IPython differ in whether its execution count is that of this cell or the next.
            number = len(self._shell.history_manager.input_hist_parsed) - 1
            call = MagicCall(number, name, line, cell)
            result = self._session.call_magic(call, responder.answer)
        if result.run is None:
            outputs.show_notes(result.notes)
            return
        responder.finish(result.run)
        roboSim.robot_state = outputs.read_robot_state(result.run)
        outputs.show_run(result.run, result.notes, responder.notes)

    def _call_data_magic(self, name: str, line: str) -> Any:
        try:
            from nbev3devsim.data_magics import MAGICS
        except ImportError as error:
            raise UsageError(
                f"%{name} needs {error.name}. Install it with pip install 'robomark-notebook[kit]'."
            ) from None
        try:
            return MAGICS[name](shlex.split(line))
        except ValueError as error:
            raise UsageError(f"The flags of %{name} cannot be read: {error}.") from None


@contextlib.contextmanager
def _usage_errors() -> Iterator[None]:
    """Show errors of an engine as sentences without a traceback."""
    try:
        yield
    except EngineError as error:
        raise UsageError(str(error)) from None
