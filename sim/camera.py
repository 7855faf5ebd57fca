"""PyBullet camera over the floor: square windows for the light sensors, seen from straight above.

The camera is orthographic and shifted by half a pixel, so that each image pixel is exactly one pixel of the printed
floor. ``light_sensors.py`` places the sensors and interprets the windows.
"""

from __future__ import annotations

import tempfile
from collections import OrderedDict
from functools import cache
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.bullet import Client, pb

Bytes = NDArray[np.uint8]

WIDTH, HEIGHT = 2362, 1143  # size of the floor in pixels and in mm
_METRE = 0.001  # metres per pixel
_PAD = 192  # black border in pixels, wider than a tile's reach: the original reads 0, 0, 0 off the floor
_TILE = 128


class LightCamera(Protocol):
    """Camera that returns windows of ``side`` x ``side`` pixels; (column, row) is the upper left pixel on the floor."""

    def render_window(self, column: int, row: int, side: int) -> Bytes:
        """Return the window as RGB, shape (side, side, 3), top row first; black outside the floor."""
        ...

    def measure_sums(self, column: int, row: int, side: int) -> tuple[int, int, int]:
        """Return the sums of R, G and B over the pixels that a round sensor of diameter ``side`` sees."""
        ...


@cache
def build_sensor_mask(side: int) -> NDArray[np.bool_]:
    """Return the mask of the round sensor, shape (side, side): 305 pixels for a side of 20 (robolab section 4)."""
    radius = side / 2
    rows, columns = np.mgrid[0:side, 0:side]
    mask = np.asarray((rows - radius) ** 2 + (columns - radius) ** 2 < radius**2)
    mask.flags.writeable = False  # all sensors of this size share it
    return mask


def _build_projection(half: float, shift: float) -> tuple[float, ...]:
    """Return the projection of a square of 2 x ``half`` metres, shifted by ``shift``, for heights 0 to 1 m."""
    left, right = -half + shift, half + shift
    scale, offset = 2 / (right - left), -(right + left) / (right - left)
    return (scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, -2, 0, offset, offset, -1, 1)


class BulletCamera:
    """Reference camera. PyBullet's software renderer takes one image of the textured floor for each window."""

    def __init__(self, pixels: Bytes) -> None:
        """Create the camera over a floor or part of one. ``pixels`` has shape (height, width, 3), row 0 at the top."""
        self._client = Client()
        self._masks: dict[int, NDArray[np.bool_]] = {}
        self._height, self._width, _ = pixels.shape
        width, height = (self._width + 2 * _PAD) * _METRE, (self._height + 2 * _PAD) * _METRE
        x, y = -_PAD * _METRE, -_PAD * _METRE
        # One triangle twice the size of the floor has no seam and one face per pixel to test.
        shape = pb.createVisualShape(
            pb.GEOM_MESH,
            vertices=[[x, y, 0], [x + 2 * width, y, 0], [x, y + 2 * height, 0]],
            indices=[0, 1, 2],
            uvs=[[0, 0], [2, 0], [0, 2]],
            normals=[[0, 0, 1]] * 3,
            rgbaColor=[1, 1, 1, 1],
            physicsClientId=self._client.id,
        )
        body = pb.createMultiBody(0, -1, shape, physicsClientId=self._client.id)
        padded_pixels = np.pad(pixels, ((_PAD, _PAD), (_PAD, _PAD), (0, 0)))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "floor.bmp"
            Image.fromarray(padded_pixels).save(file)
            texture = pb.loadTexture(str(file), physicsClientId=self._client.id)
        pb.changeVisualShape(body, -1, textureUniqueId=texture, physicsClientId=self._client.id)
        self._render(0, 0, 2, light=True)

    def close(self) -> None:
        """Disconnect from Bullet. The camera cannot take images afterwards."""
        self._client.close()

    def render_window(self, column: int, row: int, side: int) -> Bytes:
        """Return the window as RGB, shape (side, side, 3), top row first; black outside the floor."""
        if not (-side < column < self._width and -side < row < self._height):
            return np.zeros((side, side, 3), np.uint8)
        return self._render(column, row, side)

    def measure_sums(self, column: int, row: int, side: int) -> tuple[int, int, int]:
        """Return the sums of R, G and B over the pixels that a round sensor of diameter ``side`` sees."""
        mask = self._masks.get(side)
        if mask is None:
            mask = self._masks[side] = build_sensor_mask(side)
        red, green, blue = self.render_window(column, row, side)[mask].sum(axis=0, dtype=np.int64).tolist()
        return red, green, blue

    def _render(self, column: int, row: int, side: int, light: bool = False) -> Bytes:
        x = (column + side / 2) * _METRE
        y = (self._height - row - side / 2) * _METRE
        view = (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -x, -y, -0.5, 1)
        projection = _build_projection(side * _METRE / 2, _METRE / 2)
        # Ambient light alone gives the texture's own colours. The client keeps this setting.
        lighting = (
            {
                "lightAmbientCoeff": 1,
                "lightDiffuseCoeff": 0,
                "lightSpecularCoeff": 0,
                "shadow": 0,
                "lightDirection": (0, 0, -1),
            }
            if light
            else {}
        )
        image = pb.getCameraImage(
            side,
            side,
            view,
            projection,
            renderer=pb.ER_TINY_RENDERER,
            flags=pb.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client.id,
            **lighting,
        )
        rgb: Bytes = np.asarray(image[2], np.uint8).reshape(side, side, 4)[:, :, :3]
        return rgb


class _FloorPart(NamedTuple):
    """Part of the floor in pixels. Areas beyond the floor's borders are empty."""

    left: int
    top: int
    right: int
    bottom: int

    def contains_window(self, column: int, row: int, side: int) -> bool:
        """Return whether this part contains the whole window, ignoring areas off the floor."""
        return (
            self.left <= max(column, 0)
            and self.top <= max(row, 0)
            and min(column + side, WIDTH) <= self.right
            and min(row + side, HEIGHT) <= self.bottom
        )


_WHOLE = _FloorPart(0, 0, WIDTH, HEIGHT)


class CachedCamera:
    """Camera that returns the windows of a BulletCamera from cached tiles, rendered on first use.

    Results equal those of the reference in every pixel, at about a hundredth of the cost for a robot that stays on its
    track. Tiles of a single colour are not rendered.

    The BulletCamera sees only the area round the first tile until a tile elsewhere is needed. Most robots that don't
    move have a floor of their own, and a texture of the whole floor takes long.
    """

    def __init__(self, pixels: Bytes) -> None:
        """Create the camera. ``pixels`` has shape (1143, 2362, 3), row 0 at the top."""
        self._pixels = pixels
        self._camera: BulletCamera | None = None
        self._loaded_part = _WHOLE
        self._tiles: dict[tuple[int, int, int], Bytes] = {}
        self._sums: dict[tuple[int, int, int], memoryview] = {}

    def close(self) -> None:
        """Release PyBullet's 60 MB. The cached tiles remain; the next new tile loads PyBullet again."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def render_window(self, column: int, row: int, side: int) -> Bytes:
        """Return the window as RGB, shape (side, side, 3), top row first; black outside the floor."""
        if not (-side < column < WIDTH and -side < row < HEIGHT):
            return np.zeros((side, side, 3), np.uint8)
        tile = self._load_tile(column // _TILE, row // _TILE, side)
        column, row = column % _TILE, row % _TILE
        return tile[row : row + side, column : column + side]

    def measure_sums(self, column: int, row: int, side: int) -> tuple[int, int, int]:
        """Return the sums of R, G and B over the pixels that a round sensor of diameter ``side`` sees."""
        if not (-side < column < WIDTH and -side < row < HEIGHT):
            return 0, 0, 0
        key = (column // _TILE, row // _TILE, side)
        table = self._sums.get(key)
        if table is None:
            table = self._sums[key] = _compute_disc_sums(self._load_tile(*key), side)
        column, row = column % _TILE, row % _TILE
        return table[row, column, 0], table[row, column, 1], table[row, column, 2]

    def _load_tile(self, tile_column: int, tile_row: int, side: int) -> Bytes:
        key = (tile_column, tile_row, side)
        tile = self._tiles.get(key)
        if tile is None:
            tile = self._tiles[key] = self._render_tile(tile_column * _TILE, tile_row * _TILE, _TILE + side)
        return tile

    def _render_tile(self, column: int, row: int, side: int) -> Bytes:
        if 0 <= column <= WIDTH - side and 0 <= row <= HEIGHT - side:
            printed = self._pixels[row : row + side, column : column + side]
            if (printed == printed[0, 0]).all():
                # A rendering of a single colour equals the print, so PyBullet is not needed.
                return printed
        if self._camera is None:
            self._open_camera(_FloorPart(column - _TILE, row - _TILE, column + 3 * _TILE, row + 3 * _TILE))
        elif not self._loaded_part.contains_window(column, row, side):
            self.close()
            self._open_camera(_WHOLE)
        assert self._camera is not None
        return self._camera.render_window(column - self._loaded_part.left, row - self._loaded_part.top, side)

    def _open_camera(self, part: _FloorPart) -> None:
        self._loaded_part = _FloorPart(max(part.left, 0), max(part.top, 0), part.right, part.bottom)
        self._camera = BulletCamera(
            self._pixels[self._loaded_part.top : part.bottom, self._loaded_part.left : part.right]
        )


def _compute_disc_sums(tile: Bytes, side: int) -> memoryview:
    """Return the masked sums of every window in a tile, shape (128, 128, 3), computed from running sums by mask row."""
    running = np.zeros((_TILE + side, _TILE + side + 1, 3), np.int64)
    np.cumsum(tile, axis=1, out=running[:, 1:])
    total = np.zeros((_TILE, _TILE, 3), np.int64)
    for row, mask_row in enumerate(build_sensor_mask(side)):
        columns = np.flatnonzero(mask_row)
        if columns.size:
            first, last = int(columns[0]), int(columns[-1]) + 1
            rows = running[row : row + _TILE]
            total += rows[:, last : last + _TILE] - rows[:, first : first + _TILE]
    return total.astype(np.int32).data


class Cameras:
    """Small cache of cameras by image. Only the last one used keeps PyBullet open; the oldest is evicted."""

    def __init__(self, capacity: int = 3) -> None:
        """Create the cache. A camera's tiles take up to 50 MB once a robot has covered its floor."""
        self._capacity = capacity
        # The keys are object ids. Holding the image prevents reuse of its id.
        self._cameras: OrderedDict[int, tuple[Bytes, CachedCamera]] = OrderedDict()

    def open_camera(self, pixels: Bytes) -> CachedCamera:
        """Return the camera over the floor ``pixels``, which must not change afterwards."""
        entry = self._cameras.pop(id(pixels), None)
        self.close()
        if entry is None:
            while len(self._cameras) >= self._capacity:
                self._cameras.popitem(last=False)
            entry = pixels, CachedCamera(pixels)
        self._cameras[id(pixels)] = entry
        return entry[1]

    def close(self) -> None:
        """Release PyBullet's memory."""
        for _, camera in self._cameras.values():
            camera.close()
