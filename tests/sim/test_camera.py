"""The light sensors see the printed floor pixel for pixel, including the area outside the floor."""

from __future__ import annotations

import numpy as np
import pytest

from sim.camera import HEIGHT, WIDTH, BulletCamera, CachedCamera, build_sensor_mask
from sim.floors import build_floor

MARGIN = 400


@pytest.fixture(scope="module", params=["Lollipop", "noise"])
def pixels(request: pytest.FixtureRequest) -> np.ndarray:
    if request.param == "noise":
        return np.random.default_rng(7).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    return build_floor(request.param).pixels


def places(count: int) -> list[tuple[int, int, int]]:
    random = np.random.default_rng(11)
    columns = random.integers(-60, WIDTH + 40, count)
    rows = random.integers(-60, HEIGHT + 40, count)
    return [(int(x), int(y), (10, 20, 30)[i % 3]) for i, (x, y) in enumerate(zip(columns, rows, strict=True))]


@pytest.mark.parametrize("count", [250, pytest.param(1000, marks=pytest.mark.long)])
def test_no_pixel_differs_over_many_places(pixels: np.ndarray, count: int) -> None:
    padded = np.pad(pixels, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)))
    reference, cached = BulletCamera(pixels), CachedCamera(pixels)
    try:
        for column, row, side in places(count):
            printed = padded[row + MARGIN : row + MARGIN + side, column + MARGIN : column + MARGIN + side]
            assert np.array_equal(reference.render_window(column, row, side), printed), (column, row, side)
            assert np.array_equal(cached.render_window(column, row, side), printed), (column, row, side)
            sums = tuple(printed[build_sensor_mask(side)].sum(axis=0, dtype=np.int64).tolist())
            assert cached.measure_sums(column, row, side) == sums == reference.measure_sums(column, row, side)
    finally:
        reference.close()
        cached.close()


@pytest.mark.parametrize(("side", "pixels"), [(10, 69), (20, 305), (30, 697)])
def test_the_window_is_round_and_leaves_out_row_and_column_0(side: int, pixels: int) -> None:
    mask = build_sensor_mask(side)
    assert not mask[0].any()
    assert not mask[:, 0].any()
    assert mask.sum() == pixels


@pytest.mark.parametrize("place", [(-5, -5), (1180, 570), (130, 1130), (2350, 1130), (2340, 250)])
def test_a_robot_that_stays_sees_the_same_without_the_whole_floor(pixels: np.ndarray, place: tuple[int, int]) -> None:
    padded = np.pad(pixels, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)))
    camera = CachedCamera(pixels)
    try:
        for x in range(place[0] - 60, place[0] + 60, 15):
            for y in range(place[1] - 60, place[1] + 60, 15):
                printed = padded[y + MARGIN : y + MARGIN + 20, x + MARGIN : x + MARGIN + 20]
                assert np.array_equal(camera.render_window(x, y, 20), printed), (x, y)
    finally:
        camera.close()
