"""The floors, bit for bit: compared with the original's check sums where known, otherwise with its readings."""

from __future__ import annotations

import hashlib
import io
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sim import floors
from sim.errors import UsageError

pytestmark = pytest.mark.fast

#: Known values of the original.
ORIGINAL = {
    "Coloured_bands": "616569809051c5cd",
    "Rainbow_bands": "bbe70a1cdb29200c",
    "Grey_and_black": "657461cade41c1d2",
    "Square": "e91e8374e1f50305",
    "Linear_grey": "3709865d3c38c850",
    "Radial_grey": "2cc02b01f8f294ba",
    "Radial_red": "9cc7e643c608aa7e",
    "Simple_Shapes": "379af070c54069ed",
}
#: Hashes of the floors at the time when they were added.
OWN = {
    "Empty_Map": "af88c703b719accc",
    "Loop": "94bc0f2623f91e9b",
    "Two_shapes": "9e9e2cc9f10cc52a",
    "Grey_bands": "e09aad1e0b6925aa",
    "Lollipop": "439b22c7a115185a",
    "Testcard": "d868e10e40b8f338",
    "WRO_2019_Regular_Junior": "c5b8f556cfb47ff8",
    "WRO_2018_Regular_Junior": "70eab462f43eae3d",
    "FLL_2019_City_Shaper": "e88cd817a2221e75",
    "FLL_2018_Into_Orbit": "c4845dac4f644032",
    "Line_Following_Test": "0daa25b8fde63476",
    "Junction_Handling_Test": "16cd792f1a52de1c",
    "Sensor_Diameter_Test": "2c409476b4f76629",
    "Thruxton_Circuit": "a52fd676d5083510",
    "MNIST_Digits": "076964cab639951e",
    "MNIST_Digits_Black": "b693674f261720bd",
    "Obstacles_Test": "4922e1702de2054d",
    "Shuffled_Shapes": "16167627be6838b0",
}


def sensor_mean(floor: str, pose: tuple[float, float, float], sideways: float) -> NDArray[np.float64]:
    """Return the mean colour of the 305 pixels seen by a light sensor ``sideways`` mm right of the middle."""
    x, y, heading = pose
    turn = math.radians(heading) - math.pi / 2
    cosine, sine = math.cos(turn), math.sin(turn)
    column = math.trunc(cosine * sideways - sine * 30 + x - 10)
    row = math.trunc(-(sine * sideways + cosine * 30) + (1143 - y) - 10)
    rows, columns = np.mgrid[0:20, 0:20]
    window = floors.build_floor(floor).pixels[row : row + 20, column : column + 20]
    mean: NDArray[np.float64] = window[(rows - 10) ** 2 + (columns - 10) ** 2 < 100].mean(axis=0)
    return mean


@pytest.mark.parametrize("name", floors.list_floor_names())
def test_drawn_bit_for_bit(name: str) -> None:
    check_sum = (ORIGINAL | OWN)[name]
    assert hashlib.sha256(floors.build_floor(name).pixels.tobytes()).hexdigest().startswith(check_sum)


@pytest.mark.parametrize(
    ("name", "pose", "left", "right"),
    [
        ("Rainbow_bands", (270, 600, 0), (255, 0, 0), (255, 0, 0)),
        ("Simple_Shapes", (520, 900, 0), (204.8361,) * 3, (170,) * 3),
        ("Simple_Shapes", (600, 900, 0), (212.3607,) * 3, (212,) * 3),
        ("Lollipop", (1710, 615, 180), (124.4787, 124.4787, 52.577), (234.3705, 234.3705, 98.9279)),
        ("Lollipop", (750, 375, -180), (211,) * 3, (45.659,) * 3),
        ("Loop", (500.3, 211.7, 33), (167.2131,) * 3, (0,) * 3),
        ("Radial_red", (100, 400, 0), (104, 11, 11), (103.7836, 10.7082, 10.7082)),
    ],
)
def test_light_sensors_read_what_they_read_in_the_original(
    name: str, pose: tuple[float, float, float], left: tuple[float, ...], right: tuple[float, ...]
) -> None:
    assert sensor_mean(name, pose, -20) == pytest.approx(left, abs=1e-4)
    assert sensor_mean(name, pose, +20) == pytest.approx(right, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "column", "row", "colour"),
    [
        ("Empty_Map", 1181, 571, (255, 255, 255)),
        ("Grey_bands", 350, 500, (220, 220, 220)),
        ("Grey_bands", 750, 500, (211, 211, 211)),
        ("Grey_bands", 1150, 500, (128, 128, 128)),
        ("Grey_bands", 1550, 500, (0, 0, 0)),
        ("Grey_bands", 1900, 500, (0, 255, 0)),
        ("Loop", 250, 600, (0, 0, 0)),
        ("Loop", 203, 203, (255, 255, 255)),
        ("Two_shapes", 250, 650, (0, 0, 0)),
        ("Two_shapes", 1450, 650, (255, 255, 255)),
        ("Two_shapes", 1250, 650, (0, 0, 0)),
        ("Lollipop", 100, 100, (211, 211, 211)),
        ("Lollipop", 1400, 560, (0, 0, 0)),
        ("Lollipop", 1700, 400, (255, 255, 0)),
        ("Lollipop", 1900, 560, (255, 0, 0)),
        ("Lollipop", 890, 560, (211, 211, 211)),
        ("Line_Following_Test", 141, 1090, (0, 0, 0)),
        ("Line_Following_Test", 170, 1090, (255, 255, 255)),
        ("Line_Following_Test", 2138, 900, (0, 0, 0)),
        ("Line_Following_Test", 2138, 770, (255, 255, 255)),
        ("Sensor_Diameter_Test", 200, 600, (0, 0, 0)),
        ("Sensor_Diameter_Test", 1316, 600, (255, 0, 0)),
        ("Sensor_Diameter_Test", 200, 200, (0, 0, 255)),
    ],
)
def test_colour_at_a_place(name: str, column: int, row: int, colour: tuple[int, int, int]) -> None:
    assert tuple(floors.build_floor(name).pixels[row, column]) == colour


def test_lines_of_the_line_following_test_are_twenty_wide_and_start_where_the_robot_does() -> None:
    floor = floors.build_floor("Line_Following_Test")
    darkness = 1 - floor.pixels[1090, :, 0] / 255.0
    starts = [141, 440, 771, 1076, 1453, 1820, 2137]
    for start in starts:
        near = darkness[start - 25 : start + 26]
        assert near.sum() == pytest.approx(20, abs=9)  # slanting lines are wider along a row
        assert np.average(np.arange(-25, 26), weights=near) == pytest.approx(0, abs=6)
    assert darkness.sum() == pytest.approx(20 * len(starts), abs=15)
    assert floor.default_pose.x == 141


@pytest.mark.parametrize("name", floors.list_floor_names())
def test_every_floor_is_whole_and_cannot_be_changed(name: str) -> None:
    floor = floors.build_floor(name)
    assert floor.pixels.shape == (1143, 2362, 3)
    assert floor.pixels.dtype == np.uint8
    assert not floor.pixels.flags.writeable
    assert 0 <= floor.default_pose.x <= 2362
    assert 0 <= floor.default_pose.y <= 1143
    assert floor is floors.build_floor(name)


def test_default_poses_are_the_originals_where_they_are_odd() -> None:
    assert floors.build_floor("Lollipop").default_pose.heading == -180
    assert floors.build_floor("Square").default_pose.heading == -90


@pytest.mark.parametrize(
    ("y", "shapes"),
    [
        (900, floors.SHAPES),
        (700, ("right facing triangle", "diamond", "square", "left facing triangle")),
    ],
)
def test_labels_say_what_the_left_sensor_sees_from_the_course_poses(y: int, shapes: tuple[str, ...]) -> None:
    floor = floors.build_floor("Simple_Shapes")
    assert [floor.find_label(230 + 80 * column, y + 20) for column in range(len(shapes))] == list(shapes)
    assert floor.find_label(230 + 40, y + 20) is None
    assert floor.find_label(230, y - 20) is None


def test_each_label_lies_over_its_shape() -> None:
    floor = floors.build_floor("Simple_Shapes")
    for label in floor.labels:
        top, left = 1143 - int(label.y + label.height), int(label.x)
        view = floor.pixels[top : top + 20, left : left + 20, 0]
        assert 49 <= (view == 0).sum() <= 60, label


def test_without_labels_only_the_grey_patches_are_missing() -> None:
    with_labels = floors.build_floor("Simple_Shapes").pixels
    without = floors.build_floor("Simple_Shapes", labels=False).pixels
    rows, columns = np.nonzero((with_labels != without).any(axis=2))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (251, 275, 221, 639)
    assert (without[240:300] == 255).all()
    assert np.unique(without).tolist() == [0, 255]
    assert floors.build_floor("Simple_Shapes", labels=False).labels == floors.build_floor("Simple_Shapes").labels
    assert [int(with_labels[263, 231 + 80 * k, 0]) for k in range(6)] == [0, 42, 85, 127, 170, 212]


@pytest.mark.parametrize(
    ("wrong", "near"), [("simple_shapes", "Simple_Shapes"), ("Lolipop", "Lollipop"), ("zzzz", "Grey_bands")]
)
def test_an_unknown_name_is_refused_with_the_nearest(wrong: str, near: str) -> None:
    with pytest.raises(UsageError, match=near):
        floors.build_floor(wrong)


def image_bytes(size: tuple[int, int], form: str = "PNG", mode: str = "RGB") -> bytes:
    stream = io.BytesIO()
    Image.new(mode, size, 0).save(stream, form)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (image_bytes((100, 50)), "100 x 50 pixels"),
        (b"not an image", "cannot be read"),
        (b"", "cannot be read"),
        (image_bytes((2362, 1143))[:300], "cannot be read"),
        (image_bytes((2362, 1143), "BMP"), "cannot be read"),
    ],
)
def test_a_bad_image_is_refused(data: bytes, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        floors.build_floor_from_image("mat", data)


def test_an_own_image_becomes_a_floor_and_shows_white_where_it_is_clear() -> None:
    floor = floors.build_floor_from_image("mat", image_bytes((2362, 1143), mode="RGBA"))
    assert (floor.pixels == 255).all()
    assert not floor.pixels.flags.writeable
    assert floors.build_floor_from_image("mat", image_bytes((2362, 1143), "JPEG")).pixels.max() <= 2
