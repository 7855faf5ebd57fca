"""Modules for responders: the course's helpers for sensor data and networks, applied to real sensor images."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from PIL import Image
from sklearn.neural_network import MLPClassifier

from models import load_weights, onnx_format
from models.layers import DenseLayer, FlattenLayer
from paths import DATA, ROOT
from sim import floors

pytestmark = pytest.mark.fast

KIT = ROOT / "responders" / "kit"
LITE = DATA / "tensorflow_lite"
KIT_MODULES = ("nbev3devsim.load_nbev3devwidget", "nn_tools.sensor_data", "nn_tools.network_views")

#: Black pixels in the 14 x 14 focus of each shape, and the rows and columns that they fill.
SHAPES = [
    (49, (4, 10), (4, 10)),
    (51, (2, 12), (4, 12)),
    (51, (2, 12), (2, 10)),
    (53, (4, 12), (2, 12)),
    (60, (2, 11), (2, 12)),
    (51, (2, 12), (2, 10)),
]


class Kit(NamedTuple):
    robo_sim: Any
    data: ModuleType
    views: ModuleType


@pytest.fixture
def kit(monkeypatch: pytest.MonkeyPatch) -> Iterator[Kit]:
    """Yield the kit as a path root, freshly imported, and removed afterwards."""
    monkeypatch.syspath_prepend(str(KIT))
    widget, data, views = (importlib.import_module(name) for name in KIT_MODULES)
    yield Kit(widget.roboSim, data, views)
    for name in [name for name in sys.modules if name.split(".")[0] in ("nbev3devsim", "nn_tools")]:
        del sys.modules[name]


def raw(column: int, row: int) -> str:
    """Return the numbers of a 20 x 20 sensor with its upper left pixel at (column, row), as the robot sends them."""
    window = floors.build_floor("Simple_Shapes").pixels[row : row + 20, column : column + 20]
    rows, columns = np.mgrid[0:20, 0:20]
    seen = (rows - 10) ** 2 + (columns - 10) ** 2 < 100
    rgb = np.where(seen[:, :, None], window, np.array([245, 226, 225]))
    rgba = np.concatenate([rgb, np.full((20, 20, 1), 255)], axis=2)
    return ",".join(str(number) for number in rgba.ravel())


def log_shapes(kit: Kit, codes: range = range(6)) -> pd.DataFrame:
    """Return the data frame of both sensors over the shapes, in the course's poses."""
    kit.robo_sim.clear_datalog()
    for code in codes:
        kit.robo_sim.raw_image_data.append(f"left {raw(220 + 80 * code, 213)} {10 * code}")
        kit.robo_sim.raw_image_data.append(f"right {raw(220 + 80 * code, 253)} {10 * code}")
    frame: pd.DataFrame = kit.robo_sim.image_data()
    return frame


def grey(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image)


def test_images_of_the_log(kit: Kit) -> None:
    frame = log_shapes(kit)
    assert list(frame.columns) == ["side", "vals", "clock"]
    assert frame["side"].tolist() == ["left", "right"] * 6
    assert frame["clock"].tolist()[-1] == "50"
    assert len(frame["vals"][0].split(",")) == 1200
    assert kit.robo_sim.image_data("raw") is kit.robo_sim.raw_image_data
    kit.robo_sim.clear_datalog()
    assert kit.robo_sim.image_data().empty
    assert kit.data.get_sensor_image_pair(kit.robo_sim.image_data()) is None


def test_each_logged_image_is_taken_apart_once(kit: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    taken_apart = []
    process = type(kit.robo_sim).process_raw_image_data

    def counted(self: Any, raw_data: str, mode: str = "rgb", to_str: bool = True) -> Any:
        taken_apart.append(raw_data)
        return process(self, raw_data, mode, to_str)

    monkeypatch.setattr(type(kit.robo_sim), "process_raw_image_data", counted)
    for image in range(550):
        kit.robo_sim.collect([], [f"left {image % 256},0,0,255 {image}"])
        assert len(kit.robo_sim.image_data()) == image + 1
    assert len(taken_apart) == 550
    assert kit.robo_sim.image_data()["vals"].tolist() == [f"{image % 256},0,0" for image in range(550)]
    assert kit.robo_sim.image_data(mode="greyscale")["vals"].tolist()[-1] == str(549 % 256)
    # Notebooks can change the list directly.
    del kit.robo_sim.raw_image_data[1:]
    assert kit.robo_sim.image_data()["clock"].tolist() == ["0"]


def test_a_table_is_trimmed_with_its_names_or_without(kit: Kit) -> None:
    table = kit.data.df_from_image(block(slice(2, 5), slice(3, 8)), show=False)
    kept = kit.data.trim_image(table, background=255, show=False)
    assert (kept.index.tolist(), kept.columns.tolist()) == ([2, 3, 4], [3, 4, 5, 6, 7])
    anew = kit.data.trim_image(table, background=255, reindex=True, show=False, colorTheme="Reds")
    assert (anew.index.tolist(), anew.columns.tolist()) == ([0, 1, 2], [0, 1, 2, 3, 4])
    assert anew.to_numpy().tolist() == kept.to_numpy().tolist()
    assert kit.data.trim_image(table, show=False, image=True).size == (5, 3)
    assert kit.data.clear_columns(table).shape == (14, 11)
    assert kit.data.clear_columns(table, reverse=True, transpose=True).shape == (5, 14)


def test_a_progress_bar_counts_and_is_not_shown(kit: Kit, capsys: pytest.CaptureFixture[str]) -> None:
    bars = importlib.import_module("nbev3devsim.tqdma")
    bar = bars.tqdm([3, 4], desc="Two")
    assert list(bar) == [3, 4]
    assert (len(bar), bar.n, bar.total) == (2, 2, 2)
    with bars.tqdm_notebook(total=10) as other:
        other.update(4)
        other.set_postfix(loss=1)
    assert other.n == 4
    assert list(bars.trange(2, 8, 3)) == [2, 5]
    assert not bars.tqdm([])
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("code", range(6))
def test_a_pair_is_the_shape_and_its_label(kit: Kit, code: int) -> None:
    left, right = kit.data.get_sensor_image_pair(log_shapes(kit), code)
    black, rows, columns = SHAPES[code]
    assert (left.mode, left.size) == ("L", (14, 14))
    dark = grey(left) == 0
    assert dark.sum() == black
    assert tuple(np.flatnonzero(dark.any(axis=1))[[0, -1]]) == rows
    assert tuple(np.flatnonzero(dark.any(axis=0))[[0, -1]]) == columns
    assert np.unique(grey(right)).tolist() == [floors.LABEL_GREYS[code]]


def test_which_pair(kit: Kit) -> None:
    frame = log_shapes(kit)
    last = [kit.data.get_sensor_image_pair(frame, index) for index in (5, -1, None)]
    assert len({(left.tobytes(), right.tobytes()) for left, right in last}) == 1
    black_white, _ = kit.data.get_sensor_image_pair(frame, 0, mode="bw")
    assert (black_white.mode, kit.data.get_sensor_image_pair(frame, 0, mode="rgb")[0].mode) == ("1", "L")
    with pytest.raises(TypeError):
        kit.data.get_sensor_image_pair(frame.head(1))


def test_raw_numbers(kit: Kit) -> None:
    numbers = "10,20,30,255,3,4,5,255"
    process = kit.robo_sim.process_raw_image_data
    assert process(numbers) == "10,20,30,3,4,5"
    assert process(numbers, to_str=False) == ["10", "20", "30", "3", "4", "5"]
    assert process(numbers, mode="greyscale") == process(numbers, mode="reflected") == "10,3"
    assert process(numbers, mode="bw") == "1,0"
    assert kit.robo_sim.pyresponder is None


@pytest.mark.parametrize(
    ("options", "mode", "size"),
    [
        ({}, "L", (20, 20)),
        ({"mode": "bw"}, "1", (20, 20)),
        ({"mode": "rgb"}, "RGB", (20, 20)),
        ({"crop": (3, 3, 17, 17)}, "L", (14, 14)),
        ({"crop": (3, 3, 17, 17), "resize": (28, 28)}, "L", (28, 28)),
        ({"crop": (3, 3, 17, 17), "resize": "auto"}, "L", (20, 20)),
    ],
)
def test_generate_image(kit: Kit, options: dict[str, Any], mode: str, size: tuple[int, int]) -> None:
    image = kit.data.generate_image(log_shapes(kit, range(1)), 0, **options)
    assert (image.mode, image.size) == (mode, size)


def test_generate_image_shows_the_rim_and_the_shape(kit: Kit) -> None:
    frame = log_shapes(kit, range(1))
    image = grey(kit.data.generate_image(frame))
    assert image[0, 0] == 232  # luma of the original's 245, 226, 225 outside the round window
    assert (image == 0).sum() == 49
    black_white = kit.data.generate_bw_image(frame, crop=(3, 3, 17, 17))
    assert (grey(black_white) == 0).sum() == 49
    state = kit.data.get_image_from_state(raw(220, 213))
    assert (state.mode, state.getpixel((0, 0))) == ("RGB", (245, 226, 225))
    assert grey(kit.data.sensor_image_focus(state.convert("L"))).shape == (14, 14)


def test_black_and_white_is_above_the_threshold(kit: Kit) -> None:
    image = kit.data.image_from_array(np.array([[0, 127, 128, 255]]))
    assert grey(kit.data.make_image_black_and_white(image)).tolist() == [[False, False, True, True]]
    assert grey(kit.data.make_image_black_and_white(image, 200)).tolist() == [[False, False, False, True]]


def block(rows: slice, columns: slice, background: int = 255, ink: int = 0) -> Image.Image:
    pixels = np.full((14, 14), background, np.uint8)
    pixels[rows, columns] = ink
    return Image.fromarray(pixels)


def test_trim_and_pad(kit: Kit) -> None:
    image = block(slice(1, 5), slice(9, 14))
    assert kit.data.trim_image(image).size == (5, 4)
    assert kit.data.trim_image(kit.data.df_from_image(image)).shape == (4, 5)
    padded = grey(kit.data.crop_and_pad_to_fit(image))
    assert (padded == grey(block(slice(5, 9), slice(4, 9)))).all()  # 9 columns left over: 4 left, 5 right
    white_on_black = block(slice(0, 7), slice(0, 7), 0, 255)
    assert (grey(kit.data.crop_and_zoom_to_fit(white_on_black)) == 255).all()


def test_jiggle_moves_and_keeps(kit: Kit) -> None:
    image = block(slice(5, 8), slice(5, 9), 0, 200)
    moved = [grey(kit.data.jiggle(image)) for _ in range(40)]
    assert {int((each == 200).sum()) for each in moved} == {12}
    assert len({each.tobytes() for each in moved}) > 5


def test_images_arrays_and_frames_lead_back(kit: Kit) -> None:
    image = block(slice(2, 6), slice(3, 13), 240, 17)
    frame = kit.data.df_from_image(image)
    assert frame.shape == (14, 14)
    assert (grey(kit.data.image_from_df(frame)) == grey(image)).all()
    assert (kit.data.array_from_image(image, size=image.size) == grey(image)).all()
    assert (grey(kit.data.image_from_array(grey(image))) == grey(image)).all()
    wide = image.crop((0, 0, 14, 10))
    assert (kit.data.array_from_image(wide, size=wide.size) == grey(wide)).all()
    assert kit.data.get_images_features([image]).shape == (1, 196)
    assert np.linalg.norm(kit.data.get_images_features([image])) == pytest.approx(1)
    colours = kit.data.image_data_to_array(list(range(12)), 0, size=(2, 2, 3))
    assert (colours.shape, colours.dtype) == ((2, 2, 3), np.uint8)


#: First parameters as in the original nn_tools; the course calls some of them by keyword.
ORIGINAL_PARAMETERS = {
    "get_sensor_image_pair": ["image_data", "index", "mode", "threshold"],
    "predict_from_image": ["MLP", "_image_image"],
    "image_data_to_array": ["image_data", "index", "size"],
    "image_from_array": ["image_array", "mode"],
    "raw_image_data_to_array": ["tmp", "index", "size", "col"],
    "collected_image": ["df", "index", "size"],
    "generate_image": ["image_data_df", "index", "size", "mode", "crop", "resize", "fill", "threshold"],
    "generate_bw_image": ["image_data", "index", "size", "threshold", "crop", "resize"],
    "generate_signature": ["img", "threshold", "normalise", "linear", "segment", "fill", "show"],
    "generate_signature_from_series": ["s", "fill", "threshold", "binarise"],
    "make_image_black_and_white": ["img", "threshold"],
    "sensor_image_focus": ["img", "centre", "resize", "bw"],
    "trim_image": ["bw_df", "background", "reindex", "show", "colorTheme", "image", "threshold"],
    "clear_columns": ["df", "reverse", "transpose", "background", "threshold"],
    "crop_and_pad_to_fit": ["img", "background", "scale", "quiet", "threshold"],
    "crop_and_zoom_to_fit": ["img", "background", "scale", "quiet"],
    "jiggle": ["img", "background", "quiet"],
    "get_random_image": ["images_array", "labels", "show", "index"],
    "get_resized_images_array": ["images_array", "size"],
    "get_images_list_from_images_array": ["images_array"],
    "array_from_image": ["img", "size"],
    "image_data_from_image": ["img"],
    "image_from_df": ["df"],
    "df_from_image": ["img", "show", "colorTheme"],
    "style_df": ["df", "bw", "colorTheme", "threshold"],
    "zoom_img": ["img", "size", "grid"],
    "get_image_features": ["image"],
    "get_images_features": ["images_list", "normalise"],
}


@pytest.mark.parametrize("name", ORIGINAL_PARAMETERS)
def test_parameters_have_the_original_names(kit: Kit, name: str) -> None:
    assert list(inspect.signature(getattr(kit.data, name)).parameters) == ORIGINAL_PARAMETERS[name]


def test_the_widget_module_exports_progress_bars(kit: Kit) -> None:
    widget = importlib.import_module("nbev3devsim.load_nbev3devwidget")
    assert [*widget.tqdma(range(3))] == [0, 1, 2]


@pytest.mark.parametrize("name", ["boundary_models", "visualize_nn"])
def test_drawing_modules_take_any_call(kit: Kit, name: str) -> None:
    module = importlib.import_module(f"nn_tools.{name}")
    assert module.anything(1, colour="red") is None


def test_an_image_that_is_not_there_is_said(kit: Kit, capsys: pytest.CaptureFixture[str]) -> None:
    assert kit.data.raw_image_data_to_array(log_shapes(kit, range(1)), 2) is None
    assert "2" in capsys.readouterr().out


def test_signature_counts_a_row(kit: Kit) -> None:
    image = block(slice(0, 1), slice(3, 5))
    signature = kit.data.generate_signature(image)
    assert signature.shape == (14, 4)
    assert signature.iloc[0].tolist() == [2, 255, 9, 2]
    assert signature.iloc[1].tolist() == [0, 255, 14, 0]
    assert len(kit.data.generate_signature(image, linear=True)) == 56


class Network:
    """Records its inputs."""

    def __init__(self) -> None:
        self.rows: list[Any] = []

    def predict(self, rows: Any) -> NDArray[np.int64]:
        self.rows.append(np.asarray(rows))
        return np.array([3])

    def predict_proba(self, rows: Any) -> NDArray[np.float64]:
        return np.array([[0.1, 0.2, 0.1, 0.6]])


@pytest.mark.parametrize("options", [{}, {"confidence": True}, {"zoomview": True}, {"quiet": False}])
def test_prediction_divides_by_the_brightest(kit: Kit, options: dict[str, Any]) -> None:
    network = Network()
    assert kit.views.class_predict_from_image(network, block(slice(0, 7), slice(0, 14), 100, 50), **options) == 3
    assert network.rows[0].shape == (1, 196)
    assert np.unique(network.rows[0]).tolist() == [0.5, 1.0]


def test_prediction_of_a_signature(kit: Kit) -> None:
    network = Network()
    kit.views.class_predict_from_image(network, block(slice(0, 7), slice(0, 14)), signature=True)
    assert network.rows[0].shape == (1, 56)
    assert network.rows[0].max() == 1


@pytest.mark.parametrize(
    ("size", "options", "values"),
    [((20, 20), {}, 225), ((14, 14), {}, 196), ((20, 20), {"size": (14, 14)}, 196), ((28, 28), {}, 784)],
)
def test_image_class_predictor_prints(
    kit: Kit,
    capsys: pytest.CaptureFixture[str],
    size: tuple[int, int],
    options: dict[str, Any],
    values: int,
) -> None:
    network = Network()
    assert kit.views.image_class_predictor(network, Image.new("RGB", size, (9, 9, 9)), 3, **options) is None
    assert network.rows[0].shape == (1, values)
    assert capsys.readouterr().out == "Predicted label: 3\n"


def test_the_packaged_network_names_every_shape(kit: Kit, tmp_path: Path) -> None:
    import joblib

    file = tmp_path / "mlp_shapes_14x14.joblib"
    file.write_bytes(load_weights("shapes"))
    network = joblib.load(file)
    frame = log_shapes(kit)
    answers = [
        kit.views.class_predict_from_image(network, kit.data.get_sensor_image_pair(frame, code)[0]) for code in range(6)
    ]
    assert answers == list(range(6))
    assert "MLPClassifier" in repr(network)
    assert network.predict_proba(np.ones((1, 196))).sum() == pytest.approx(1)


def test_training_learns_rows_of_length_one(kit: Kit, capsys: pytest.CaptureFixture[str]) -> None:
    frame = log_shapes(kit)
    images = [kit.data.get_sensor_image_pair(frame, code)[0] for code in (0, 4)] * 20
    labels = [0, 4] * 20
    network = kit.views.quick_progress_tracked_training(
        images, labels, MLP=MLPClassifier((20,), random_state=1), max_iterations=60, report=True
    )
    assert "accuracy" in capsys.readouterr().out
    assert network.predict(kit.data.get_images_features(images[:2])).tolist() == [0, 4]
    kit.views.test_and_report_random_images(network, kit.data.get_random_image, images, labels, num_samples=30)
    report = capsys.readouterr().out
    assert [line.split()[-1] for line in report.split("\n") if "accuracy" in line] == ["30"]


def test_the_make_up_of_a_network_is_printed_and_given(kit: Kit, capsys: pytest.CaptureFixture[str]) -> None:
    network = MLPClassifier((3,), random_state=1).partial_fit([[0, 1], [1, 0]], [0, 1], classes=[0, 1])
    assert kit.views.network_structure(network, show=True, weights=True) is None
    assert "Number of input features: 2" in capsys.readouterr().out
    assert kit.views.network_structure(network, report=False, retval=True) == (2, 3, 1, (3,))
    table = kit.views.how_did_I_do(network, pd.DataFrame({"x": [[0, 1]], "y": [0]}), "x", "y")
    assert table.columns.tolist() == ["Expected", "Predicted", "Correct"]
    assert "out of 1 correct" in capsys.readouterr().out


def test_resizing_cuts_to_black_and_white_at_one_hundred(kit: Kit) -> None:
    images = [Image.new("L", (28, 28), level) for level in (100, 101)]
    resized = kit.views.resized_images_pipeline(images)
    assert [(image.size, np.unique(grey(image)).tolist()) for image in resized] == [
        ((14, 14), [0]),
        ((14, 14), [255]),
    ]


@pytest.mark.parametrize("name", ["show_loss", "preview_weights"])
def test_what_only_shows_does_nothing(kit: Kit, name: str) -> None:
    assert getattr(kit.views, name)(Network(), retval=True) is None
    assert kit.data.zoom_img(Image.new("L", (2, 2)), size=(3, 3), grid=False) is None


@pytest.fixture
def cnn(kit: Kit) -> Any:
    """Return a small network of digits in TensorFlow Lite's format."""
    return kit.views.cnn_load(LITE / "digits.tflite", LITE / "labels.txt")


def test_a_tensorflow_lite_network_comes_with_its_details_and_labels(
    kit: Kit, cnn: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cnn[1] == list("0123456789")
    inputs, outputs, is_float, height, width = kit.views.cnn_get_details(cnn)
    assert (inputs[0]["shape"].tolist(), outputs[0]["shape"].tolist()) == ([1, 28, 28, 1], [1, 10])
    assert (is_float, height, width) == (True, 28, 28)
    assert kit.views.cnn_get_details(cnn, report=True) is None
    assert capsys.readouterr().out.startswith("\nInput: [{'name': ")


@pytest.mark.parametrize(("file", "least"), [("digits.tflite", 50), ("digits-quantized.tflite", 49)])
def test_tensorflow_lite_networks_read_digits_that_the_sensor_sees(kit: Kit, file: str, least: int) -> None:
    network = kit.views.cnn_load(LITE / file, LITE / "labels.txt")
    sheet = floors.build_floor("MNIST_Digits", seed=101)
    right = 0
    for number, label in enumerate(sheet.labels[:55]):
        row, column = divmod(number, 20)
        # The focus of the left light sensor at the course's pose, in the floor's image.
        top, left = 56 + 100 * row, 73 + 100 * column
        image = Image.fromarray(sheet.pixels[top : top + 14, left : left + 14]).convert("L")
        results = kit.views.cnn_test_with_image(network, image, retval=True)
        right += network[1][int(results.argmax())] == label.label
    assert right >= least


def test_the_likeliest_classes_are_printed_as_in_the_course(
    kit: Kit, cnn: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    results = np.array([0.5, 0.125, 0.25, 0.125, 0, 0, 0, 0, 0, 0], np.float32)
    kit.views.cnn_rank_results(results, cnn[1], rank=2)
    kit.views.cnn_rank_results(results, rank=1)
    assert capsys.readouterr().out == "0.500000: 0\n0.250000: 2\n0.001961: \n"
    assert kit.views.cnn_test_with_image(cnn, Image.new("L", (14, 14), 9), rank=3) is None
    lines = capsys.readouterr().out.splitlines()
    assert [len(line.split(": ")) for line in lines] == [2, 2, 2]
    assert sorted(lines, reverse=True) == lines


def test_without_litert_the_sentence_says_what_to_use_instead(kit: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ai_edge_litert.interpreter", None)
    with pytest.raises(ImportError, match=r"mnist.tflite cannot be loaded: .*robomark\[tflite\].*load_onnx"):
        kit.views.cnn_load()


def test_a_network_with_its_weights_in_another_file_is_refused(
    kit: Kit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = onnx_format._encode_bytes_field

    def write_external(number: int, data: bytes) -> bytes:
        if number != 9:  # TensorProto.raw_data; 13 is external_data, and 14 is data_location
            return write(number, data)
        return write(13, write(1, b"location") + write(2, b"net.data")) + onnx_format._encode_integer_field(14, 1)

    monkeypatch.setattr(onnx_format, "_encode_bytes_field", write_external)
    layers = [FlattenLayer(), DenseLayer(4, 2, np.random.default_rng(1))]
    (tmp_path / "net.onnx").write_bytes(onnx_format.build_onnx_file(layers, 2, 2))
    (tmp_path / "net.data").write_bytes(bytes(64))
    with pytest.raises(ValueError, match=r"^net.onnx has its weights in another file; save the network as one file, "):
        importlib.import_module("nn_tools").load_onnx(tmp_path / "net.onnx")


@pytest.mark.long
def test_the_kit_needs_nothing_of_ours_and_nothing_that_draws() -> None:
    loads = "; ".join(f"import {name}" for name in KIT_MODULES)
    code = f"import sys; sys.path.insert(0, {str(KIT)!r}); {loads}; print(*{{n.split('.')[0] for n in sys.modules}})"
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not loaded & {"robomark", "sim", "models", "submissions", "responders", "service"}
    assert not loaded & {"matplotlib", "IPython", "tqdm", "tensorflow"}
