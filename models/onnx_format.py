"""Writer of ONNX files: the parts of Protocol Buffers and of the ONNX schema that the layers need.

onnxruntime reads the files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.layers import Dense, Filters, Flat, Floats, Halving, Layer, Positive

_IR_VERSION, _OPERATOR_SET = 8, 17
_FLOAT, _INTEGERS = 1, 7  # values of TensorProto.DataType and AttributeProto.AttributeType


@dataclass(frozen=True, slots=True)
class _Node:
    """One ONNX operator: its name, tensors and integer attributes."""

    operator: str
    tensors: tuple[Floats, ...] = ()
    attributes: Mapping[str, Sequence[int]] = field(default_factory=dict)


def onnx_file(layers: Iterable[Layer], side: int, classes: int) -> bytes:
    """Return an ONNX file of the network: input shape (n, 1, side, side), output shape (n, classes)."""
    nodes = [*_nodes(layers, side), _Node("Softmax")]
    graph = b"".join(
        (
            *(_bytes(1, _node(number, node)) for number, node in enumerate(nodes)),
            _bytes(2, b"network"),
            *(
                _bytes(5, _tensor(_tensor_name(number, index), tensor))
                for number, node in enumerate(nodes)
                for index, tensor in enumerate(node.tensors)
            ),
            _bytes(11, _value(_step_name(0), (1, side, side))),
            _bytes(12, _value(_step_name(len(nodes)), (classes,))),
        )
    )
    operators = _bytes(1, b"") + _whole(2, _OPERATOR_SET)
    return _whole(1, _IR_VERSION) + _bytes(2, b"robomark") + _bytes(7, graph) + _bytes(8, operators)


def _nodes(layers: Iterable[Layer], side: int) -> Iterator[_Node]:
    """Return the operators of the layers. ONNX puts channels before height and width; ``layers`` put them last."""
    shape = (side, side, 1)
    for layer in layers:
        match layer:
            case Filters():
                filters, offsets = layer.weights
                turned = filters.reshape(layer.side, layer.side, shape[2], -1).transpose(3, 2, 0, 1)
                yield _Node("Conv", (turned, offsets), {"pads": [layer.margin] * 4})
                smaller = 2 * layer.margin - layer.side + 1
                shape = (shape[0] + smaller, shape[1] + smaller, len(offsets))
            case Halving():
                yield _Node("MaxPool", (), {"kernel_shape": [2, 2], "strides": [2, 2]})
                shape = (shape[0] // 2, shape[1] // 2, shape[2])
            case Positive():
                yield _Node("Relu")
            case Flat():
                yield _Node("Flatten")
            case Dense():
                weights, offsets = layer.weights
                yield _Node("Gemm", (weights.reshape(*shape, -1).transpose(2, 0, 1, 3).reshape(weights.shape), offsets))
                shape = (1, 1, len(offsets))


def _node(number: int, node: _Node) -> bytes:
    inputs = [_step_name(number), *(_tensor_name(number, index) for index in range(len(node.tensors)))]
    return b"".join(
        (
            *(_bytes(1, name.encode()) for name in inputs),
            _bytes(2, _step_name(number + 1).encode()),
            _bytes(4, node.operator.encode()),
            *(
                _bytes(
                    5, _bytes(1, name.encode()) + b"".join(_whole(8, value) for value in values) + _whole(20, _INTEGERS)
                )
                for name, values in node.attributes.items()
            ),
        )
    )


def _tensor(name: str, values: Floats) -> bytes:
    sizes = b"".join(_whole(1, size) for size in values.shape)
    return (
        sizes + _whole(2, _FLOAT) + _bytes(8, name.encode()) + _bytes(9, np.ascontiguousarray(values, "<f4").tobytes())
    )


def _value(name: str, sizes: Sequence[int]) -> bytes:
    """Describe a value with a variable number of images and ``sizes`` for each image."""
    shape = _bytes(1, _bytes(2, b"n")) + b"".join(_bytes(1, _whole(1, size)) for size in sizes)
    kind = _bytes(1, _whole(1, _FLOAT) + _bytes(2, shape))
    return _bytes(1, name.encode()) + _bytes(2, kind)


def _step_name(number: int) -> str:
    return f"step {number}"


def _tensor_name(number: int, index: int) -> str:
    return f"weights {number}.{index}"


def _whole(field_number: int, value: int) -> bytes:
    return _number(field_number << 3) + _number(value)


def _bytes(field_number: int, data: bytes) -> bytes:
    return _number(field_number << 3 | 2) + _number(len(data)) + data


def _number(value: int) -> bytes:
    """Encode a number as a varint: seven bits per byte, lowest bits first."""
    data = bytearray()
    while value > 127:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes((*data, value))
