"""Names of the course's nn_tools that responder code uses. Functions that only draw or animate have no effect.

In addition: ``load_weights``, ``save_weights`` and ``load_onnx`` for networks in formats other than pickle.
"""

import importlib
from typing import Any

__all__ = ["load_onnx", "load_weights", "save_weights"]


def __getattr__(name: str) -> Any:
    # Not before it is asked for: some assignments do without it.
    if name in __all__:
        return getattr(importlib.import_module("nn_tools.weights"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
