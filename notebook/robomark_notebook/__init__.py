"""RoboLab in a Jupyter notebook: run, watch and check robot programs where students write them.

``%load_ext robomark_notebook`` loads it. Where the original simulator is not installed, ``%load_ext nbev3devsim``
does the same.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

#: The course's modules: nbev3devsim, nn_tools, blockdiag_magic.
_DROP_INS = Path(__file__).parent / "drop_ins"


def load_ipython_extension(shell: Any) -> None:
    """Register the magics. If the original simulator is installed, its magics and modules are left alone."""
    from robomark_notebook.magics import register_magics

    spec = importlib.util.find_spec("nbev3devsim")
    if spec is None:
        # A .pth file has done this already, if the package is in a folder where Python reads such files.
        sys.path.append(str(_DROP_INS))
    is_original = spec is not None and not Path(spec.origin or "").is_relative_to(_DROP_INS)
    register_magics(shell, has_simulator=is_original)
