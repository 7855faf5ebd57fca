"""Writer of ONNX files: the parts of Protocol Buffers and of the ONNX schema that the layers need.

onnxruntime reads the files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.layers import ConvolutionLayer, DenseLayer, FlattenLayer, Floats, Layer, MaxPoolingLayer, ReluLayer

_IR_VERSION, _OPERATOR_SET = 8, 17
_FLOAT, _INTEGERS = 1, 7  # values of TensorProto.DataType and AttributeProto.AttributeType


@dataclass(frozen=True, slots=True)
class _Node:
    """One ONNX operator: its name, tensors and integer attributes."""

    operator: str
    tensors: tuple[Floats, ...] = ()
    attributes: Mapping[str, Sequence[int]] = field(default_factory=dict)


def build_onnx_file(layers: Iterable[Layer], side: int, classes: int) -> bytes:
    """Return an ONNX file of the network: input shape (n, 1, side, side), output shape (n, classes)."""
    nodes = [*_build_nodes(layers, side), _Node("Softmax")]
    graph = b"".join(
        (
            *(_encode_bytes_field(1, _encode_node(number, node)) for number, node in enumerate(nodes)),
            _encode_bytes_field(2, b"network"),
            *(
                _encode_bytes_field(5, _encode_tensor(_format_tensor_name(number, index), tensor))
                for number, node in enumerate(nodes)
                for index, tensor in enumerate(node.tensors)
            ),
            _encode_bytes_field(11, _encode_value(_format_step_name(0), (1, side, side))),
            _encode_bytes_field(12, _encode_value(_format_step_name(len(nodes)), (classes,))),
        )
    )
    operators = _encode_bytes_field(1, b"") + _encode_integer_field(2, _OPERATOR_SET)
    return (
        _encode_integer_field(1, _IR_VERSION)
        + _encode_bytes_field(2, b"robomark")
        + _encode_bytes_field(7, graph)
        + _encode_bytes_field(8, operators)
    )


def _build_nodes(layers: Iterable[Layer], side: int) -> Iterator[_Node]:
    """Return the operators of the layers. ONNX puts channels before height and width; ``layers`` put them last."""
    shape = (side, side, 1)
    for layer in layers:
        match layer:
            case ConvolutionLayer():
                filters, offsets = layer.weights
                transposed_filters = filters.reshape(layer.side, layer.side, shape[2], -1).transpose(3, 2, 0, 1)
                yield _Node("Conv", (transposed_filters, offsets), {"pads": [layer.margin] * 4})
                smaller = 2 * layer.margin - layer.side + 1
                shape = (shape[0] + smaller, shape[1] + smaller, len(offsets))
            case MaxPoolingLayer():
                yield _Node("MaxPool", (), {"kernel_shape": [2, 2], "strides": [2, 2]})
                shape = (shape[0] // 2, shape[1] // 2, shape[2])
            case ReluLayer():
                yield _Node("Relu")
            case FlattenLayer():
                yield _Node("Flatten")
            case DenseLayer():
                weights, offsets = layer.weights
                yield _Node("Gemm", (weights.reshape(*shape, -1).transpose(2, 0, 1, 3).reshape(weights.shape), offsets))
                shape = (1, 1, len(offsets))


def _encode_node(number: int, node: _Node) -> bytes:
    inputs = [_format_step_name(number), *(_format_tensor_name(number, index) for index in range(len(node.tensors)))]
    return b"".join(
        (
            *(_encode_bytes_field(1, name.encode()) for name in inputs),
            _encode_bytes_field(2, _format_step_name(number + 1).encode()),
            _encode_bytes_field(4, node.operator.encode()),
            *(
                _encode_bytes_field(
                    5,
                    _encode_bytes_field(1, name.encode())
                    + b"".join(_encode_integer_field(8, value) for value in values)
                    + _encode_integer_field(20, _INTEGERS),
                )
                for name, values in node.attributes.items()
            ),
        )
    )


def _encode_tensor(name: str, values: Floats) -> bytes:
    sizes = b"".join(_encode_integer_field(1, size) for size in values.shape)
    return (
        sizes
        + _encode_integer_field(2, _FLOAT)
        + _encode_bytes_field(8, name.encode())
        + _encode_bytes_field(9, np.ascontiguousarray(values, "<f4").tobytes())
    )


def _encode_value(name: str, sizes: Sequence[int]) -> bytes:
    """Describe a value with a variable number of images and ``sizes`` for each image."""
    shape = _encode_bytes_field(1, _encode_bytes_field(2, b"n")) + b"".join(
        _encode_bytes_field(1, _encode_integer_field(1, size)) for size in sizes
    )
    kind = _encode_bytes_field(1, _encode_integer_field(1, _FLOAT) + _encode_bytes_field(2, shape))
    return _encode_bytes_field(1, name.encode()) + _encode_bytes_field(2, kind)


def _format_step_name(number: int) -> str:
    return f"step {number}"


def _format_tensor_name(number: int, index: int) -> str:
    return f"weights {number}.{index}"


def _encode_integer_field(field_number: int, value: int) -> bytes:
    return _encode_varint(field_number << 3) + _encode_varint(value)


def _encode_bytes_field(field_number: int, data: bytes) -> bytes:
    return _encode_varint(field_number << 3 | 2) + _encode_varint(len(data)) + data


def _encode_varint(value: int) -> bytes:
    """Encode a number as a varint: seven bits per byte, lowest bits first."""
    data = bytearray()
    while value > 127:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes((*data, value))
