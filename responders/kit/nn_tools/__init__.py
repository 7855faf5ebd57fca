"""Names of the course's nn_tools that responder code uses; what only draws or animates does nothing here.

Beyond the course's: ``load_weights``, ``save_weights`` and ``load_onnx`` for networks that are no pickles.
"""

from nn_tools.weights import load_onnx, load_weights, save_weights

__all__ = ["load_onnx", "load_weights", "save_weights"]
