"""Training and use of the course's networks, without the drawings of networks and losses that a notebook shows.

As in the course, predictions divide an image by its brightest pixel, and training divides it by its length.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image
from sklearn.metrics import classification_report, confusion_matrix
from sklearn.neural_network import MLPClassifier
from sklearn.preprocessing import normalize

from nn_tools.sensor_data import (
    as_image,
    crop_and_zoom_to_fit,
    generate_signature,
    get_image_features,
    get_images_features,
    jiggle,
    make_image_black_and_white,
)
from nn_tools.weights import check_classifier

#: An interpreter of LiteRT, which has no types, and labels.
CNN = tuple[Any, list[str]]
Details = tuple[Any, Any, bool, int, int]

_NO_LITERT = (
    "this Robomark has no ai-edge-litert (pip install robomark[tflite]); use a scikit-learn network, plain weights "
    "(.npz), or ONNX's format with nn_tools.load_onnx"
)


def class_predict_from_image(
    MLP: Any,
    img: Image.Image,
    quiet: bool = True,
    zoomview: bool = False,
    confidence: bool = False,
    signature: bool = False,
) -> Any:
    """Return the predicted class of the image. ``zoomview`` and ``confidence`` draw nothing."""
    values = generate_signature(img, linear=True) if signature else get_image_features(img)
    row = normalize([values], norm="max")
    check_classifier(MLP, len(values))
    prediction = MLP.predict(row)[0]
    if not quiet:
        print(f"MLP predicts {prediction}")
    return prediction


def predict_and_report_from_image(
    MLP: Any,
    img: Image.Image,
    label: Any = "",
    jiggled: bool = False,
    cropzoom: bool = False,
    quiet: bool = False,
    zoomview: bool = False,
    confidence: bool = False,
    signature: bool = False,
) -> None:
    """Print the predicted class of the image, and whether it equals the label."""
    if jiggled:
        img = jiggle(img)
    if cropzoom:
        img = crop_and_zoom_to_fit(img)
    prediction = class_predict_from_image(MLP, img, signature=signature)
    named = label is not None and label != ""
    beside = f" compared to label {label}; classification is {prediction == label}" if named else ""
    print(f"MLP predicts {prediction}{beside}")


def image_class_predictor(
    MLP: Any,
    img: Image.Image,
    label: Any = "",
    size: tuple[int, int] | None = None,
    greyscale_convert: bool = True,
    eds_crop: bool = False,
) -> None:
    """Print the predicted label. A sensor image of 20 x 20 is cut to 15 x 15, as in the original."""
    if greyscale_convert:
        img = img.convert("L")
    if img.size == (20, 20):
        img = img.crop((3, 3, 18, 18))
    if size is not None:
        img = img.resize(size, Image.Resampling.LANCZOS)
    print(f"Predicted label: {class_predict_from_image(MLP, img)}")


def progress_tracked_training(
    data: Any,
    labels: Any,
    MLP: Any = None,
    hidden_layer_sizes: Any = (30,),
    max_iterations: int = 40,
    loss: bool = True,
    report: bool = True,
    structure: bool = False,
    weights: bool = False,
) -> Any:
    """Return a network trained one pass at a time. ``report`` prints its results on the training data."""
    classes = np.unique(labels)
    if MLP is None:
        MLP = MLPClassifier(hidden_layer_sizes=hidden_layer_sizes, max_iter=1)
    for _pass in range(max_iterations):
        MLP.partial_fit(data, labels, classes=classes)
    if structure:
        network_structure(MLP)
    if report:
        test_and_report(MLP, data, labels)
    return MLP


def quick_progress_tracked_training(
    images_list: Any,
    labels: Sequence[Any],
    test_limit: int | None = None,
    MLP: Any = None,
    hidden_layer_sizes: Any = (30,),
    max_iterations: int = 40,
    loss: bool = True,
    structure: bool = True,
    report: bool = True,
    weights: bool = False,
    jiggled: bool = False,
    size: tuple[int, int] | None = None,
    use_signature: bool = False,
    image_data: bool = True,
    fill: int = 0,
) -> Any:
    """Return a network trained on all images except the last tenth; on rows of numbers without ``image_data``.

    ``report`` prints its results on the last tenth.
    """
    rows = _build_rows(images_list, size, jiggled, use_signature, fill) if image_data else images_list
    kept = len(rows) - (max(len(rows) // 10, 1) if test_limit is None else test_limit)
    MLP = progress_tracked_training(
        normalize(rows[:kept], axis=1),
        list(labels)[:kept],
        MLP,
        hidden_layer_sizes,
        max_iterations,
        report=False,
        structure=structure,
    )
    if report and kept < len(rows):
        test_and_report(MLP, normalize(rows[kept:], axis=1), list(labels)[kept:])
    return MLP


def _build_rows(images: Any, size: tuple[int, int] | None, jiggled: bool, use_signature: bool, fill: int) -> list[Any]:
    prepared_images = [as_image(image) for image in images] if size is None else resized_images_pipeline(images, size)
    prepared_images = [jiggle(image) for image in prepared_images] if jiggled else prepared_images
    if use_signature:
        return [generate_signature(image, linear=True, fill=fill) for image in prepared_images]
    return [get_image_features(image) for image in prepared_images]


def resized_images_pipeline(
    images_array: Any,
    size: tuple[int, int] = (14, 14),
    bw: bool = True,
    normalise: bool = True,
    images: bool = True,
) -> Any:
    """Return the images resized and converted to black and white, with a threshold of 100.

    With ``images=False`` rows of values, of length 1 unless ``normalise`` is off.
    """
    resized = [as_image(image).resize(size, Image.Resampling.LANCZOS) for image in images_array]
    if bw:
        resized = [make_image_black_and_white(image, 100).convert("L") for image in resized]
    return resized if images else get_images_features(resized, normalise)


def how_did_I_do(MLP: Any, df: Any, samples: str, expected: str) -> Any:
    """Return a table with the predictions for the column ``samples`` beside the column ``expected``."""
    table = pd.DataFrame({"Expected": df[expected], "Predicted": MLP.predict(df[samples].to_list())})
    table["Correct"] = table["Expected"] == table["Predicted"]
    print(f"The network got {table['Correct'].sum()} out of {len(table)} correct.")
    return table


def test_and_report(
    MLP: Any,
    test_data: Any,
    test_labels: Any,
    loss: bool = False,  # noqa: PT028
) -> None:
    """Print the classification report and the confusion matrix."""
    predictions = MLP.predict(test_data)
    print(classification_report(test_labels, predictions, zero_division=0))
    print(confusion_matrix(test_labels, predictions))


def test_and_report_image_data(
    MLP: Any,
    test_images: Any,
    test_labels: Any,
    loss: bool = False,  # noqa: PT028
) -> None:
    """Print the classification report and the confusion matrix for images, or arrays of them."""
    rows = [np.asarray(image).ravel() for image in test_images]
    test_and_report(MLP, normalize(rows, norm="max"), test_labels)


def generate_N_random_samples(
    randfunc: Callable[[Any, Any], tuple[Image.Image, Any]],
    images_array: Any,
    labels: Sequence[Any],
    num_samples: int = 100,
    jiggled: bool = False,
    cropzoom: bool = False,
    use_signature: bool = False,
    fill: int = 0,
) -> tuple[list[Any], list[Any]]:
    """Return random rows of pixels, or signatures, with labels. ``randfunc(images_array, labels)`` draws them."""
    drawn = [randfunc(images_array, labels) for _ in range(num_samples)]
    images = [jiggle(image) if jiggled else image for image, _ in drawn]
    images = [crop_and_zoom_to_fit(image) if cropzoom else image for image in images]
    if use_signature:
        rows = [generate_signature(image, fill=fill, linear=True) for image in images]
    else:
        rows = [np.array([get_image_features(image)]) for image in images]
    return rows, [label for _, label in drawn]


def test_and_report_random_images(
    MLP: Any,
    randfunc: Callable[[Any, Any], tuple[Image.Image, Any]],
    images_array: Any,
    labels: Sequence[Any],
    num_samples: int = 100,  # noqa: PT028
    jiggled: bool = False,  # noqa: PT028
    cropzoom: bool = False,  # noqa: PT028
    use_signature: bool = False,  # noqa: PT028
    loss: bool = False,  # noqa: PT028
) -> None:
    """Print the report on images that ``randfunc`` draws, such as ``get_random_image``."""
    rows, drawn = generate_N_random_samples(
        randfunc, images_array, labels, num_samples, jiggled, cropzoom, use_signature
    )
    if use_signature:
        test_and_report(MLP, normalize(rows, axis=1), drawn)
    else:
        test_and_report_image_data(MLP, rows, drawn)


def network_structure_report(MLP: Any) -> None:
    """Print the structure of a trained network."""
    print(f"Number of input features: {MLP.n_features_in_}")
    print(f"Number of layers: {MLP.n_layers_}")
    print(f"Number of outputs: {MLP.n_outputs_}")
    print(f"Hidden layer sizes: {MLP.hidden_layer_sizes}")
    print(f"Number of training iterations: {MLP.n_iter_}")


def network_structure(
    MLP: Any,
    report: bool = True,
    show: bool = False,
    weights: bool = False,
    loss: bool = False,
    retval: bool = False,
) -> Any:
    """Print the structure. With ``retval``, return inputs, layers, outputs and hidden layers. Draws nothing."""
    if report:
        network_structure_report(MLP)
    return (MLP.n_features_in_, MLP.n_layers_, MLP.n_outputs_, MLP.hidden_layer_sizes) if retval else None


def reshape_data(img: Any, n_images: int = 3000, size: tuple[int, int] = (28, 28)) -> tuple[Any, Any, Any]:
    """Return the images as an array, as ``n_images`` rows of numbers, and as rows divided by their largest number."""
    images = np.array(img)
    rows = images.reshape(n_images, size[0] * size[1])
    return images, rows, normalize(rows, norm="max", axis=1)


def _show_nothing(*_args: Any, **_kwargs: Any) -> None:
    """Placeholder for a function that draws in a notebook."""


show_loss = preview_weights = multiply_image_by_weights = _show_nothing
prediction_class_chart = displayImageLabelPairFromArray = test_display = _show_nothing


def cnn_load(
    fpath: str | os.PathLike[str] = "./mnist.tflite",
    fpath_labels: str | os.PathLike[str] | None = "./mnist_tflite_labels.txt",
) -> CNN:
    """Return the network of a TensorFlow Lite file, and its labels from a file with one per line.

    Raises ValueError with a sentence when the file is no such network, ImportError when ai-edge-litert is missing.
    """
    name = Path(fpath).name
    try:
        from ai_edge_litert.interpreter import Interpreter
    except ImportError:
        raise ImportError(f"{name} cannot be loaded: {_NO_LITERT}") from None
    data = Path(fpath).read_bytes()
    try:
        interpreter = Interpreter(model_content=data, num_threads=1)
        interpreter.allocate_tensors()
    except Exception as error:
        raise ValueError(
            f"{name} cannot be read as a network in TensorFlow Lite's format: {str(error)[:200]}"
        ) from None
    labels = [line.strip() for line in Path(fpath_labels).read_text().splitlines()] if fpath_labels else []
    return interpreter, labels


def cnn_get_details(cnn: CNN, report: bool = False) -> Details | None:
    """Return input, output, whether inputs are floats, height and width; with ``report``, print only."""
    details = _read_details(cnn)
    if not report:
        return details
    print(f"\nInput: {details[0]}\n\nOutput: {details[1]}\n")
    return None


def _read_details(cnn: CNN) -> Details:
    inputs, outputs = cnn[0].get_input_details(), cnn[0].get_output_details()
    _, height, width = inputs[0]["shape"][:3]
    return inputs, outputs, inputs[0]["dtype"] == np.float32, height, width


def cnn_rank_results(results: NDArray[Any], tf_labels: Sequence[str] | None = None, rank: Any = 5) -> None:
    """Print the likeliest classes, best first; divided by 255 if their numbers add up to 0 or 1, as in the original."""
    best = results.argsort()[::-1][: rank if isinstance(rank, int) else 5]
    whole = 1 if best.sum() > 1 else 255
    for number in best:
        print(f"{results[number] / whole:08.6f}: {tf_labels[number] if tf_labels else ''}")


def cnn_test_with_image(
    cnn: CNN, img: Image.Image, tf_labels: Sequence[str] = "", retval: bool = False, rank: int | None = None
) -> NDArray[Any] | None:
    """Return the network's output for the resized image, with ``retval``. Prints the ``rank`` most likely classes."""
    interpreter, labels = cnn
    inputs, outputs, is_float, height, width = _read_details(cnn)
    shape, kind = inputs[0]["shape"], inputs[0]["dtype"]
    values = np.asarray(img.resize((width, height)))
    if values.size != np.prod(shape):
        raise ValueError(f"this network is for images of shape {shape.tolist()}, but was shown one of {values.shape}")
    if is_float:
        values = (values.astype(np.float32) - 127.5) / 127.5
    interpreter.set_tensor(inputs[0]["index"], values.reshape(shape).astype(kind))
    interpreter.invoke()
    results = np.squeeze(interpreter.get_tensor(outputs[0]["index"]))
    if rank:
        cnn_rank_results(results, tf_labels or labels, rank)
    return results if retval else None
