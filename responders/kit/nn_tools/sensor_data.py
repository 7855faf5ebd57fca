"""From the numbers that the robot's light sensors send to images, and what the course does with those.

Images are Pillow's, values 0 to 255; functions that only show something return None.
"""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

Box = tuple[int, int, int, int]

_FOCUS: Box = (3, 3, 17, 17)
_SIZE = (20, 20, 3)


def load_MNIST_images_array(fn: str) -> np.ndarray:
    """A strip of 28 x 28 images under each other as an array (n, 28, 28)."""
    return np.asarray(Image.open(fn).convert("L")).reshape(-1, 28, 28)


def load_MNIST_labels(fn: str) -> list[int]:
    labels: list[int] = json.loads(Path(fn).read_text())
    return labels


def load_MNIST_images_and_labels(
    image_fn: str = "mnist_batch_0.png", label_fn: str = "labels.txt", images: bool = True
) -> tuple[Any, list[int]]:
    """Images (a list, or an array with ``images=False``) and their labels."""
    array = load_MNIST_images_array(image_fn)
    return (get_images_list_from_images_array(array) if images else array), load_MNIST_labels(label_fn)


def report_light_sensor(state: Any, side: str) -> None:
    """Print what the simulator's state says of one light sensor."""
    values = getattr(state, "state", state)
    print(
        f"{side.capitalize()} light sensor:",
        f"raw {values.get(f'{side}_light_raw')}, R {values.get(f'{side}_light')},",
        f"R% {values.get(f'{side}_light_pc')}, full% {values.get(f'{side}_light_full')}",
    )


def sensor_image_focus(img: Image.Image, centre: Box = _FOCUS, resize: Any = None, bw: bool = False) -> Image.Image:
    """The part of a sensor image that lies inside the round window: 14 x 14 pixels unless told otherwise."""
    size = img.size
    img = img.crop(centre)
    if resize is not None:
        img = img.resize(size if resize == "auto" else resize, Image.Resampling.LANCZOS)
    return make_image_black_and_white(img) if bw else img


def get_sensor_image_pair(
    df: pd.DataFrame, index: int | None = None, mode: str = "greyscale", threshold: int = 127
) -> tuple[Image.Image, Image.Image] | None:
    """The left and the right focus image of pair ``index`` (rows 2i and 2i+1), -1 for the last pair."""
    if df.empty:
        return None
    if index is None or index == -1:
        if len(df) < 2:
            raise TypeError("an image pair needs two rows, left and right")
        first = len(df) - 2
    else:
        first = 2 * index
    left, right = (sensor_image_focus(generate_image(df, row)) for row in (first, first + 1))
    if mode == "bw":
        return make_image_black_and_white(left, threshold), make_image_black_and_white(right, threshold)
    return left, right


def get_random_image(
    images: Sequence[Image.Image], labels: Sequence[Any] | None = None, show: bool = False, index: int | None = None
) -> tuple[Image.Image, Any]:
    """An image and its label, by chance unless ``index`` is given."""
    place = random.randrange(len(images)) if index is None else index
    return images[place], None if labels is None else labels[place]


def image_data_to_array(list_of_values: Sequence[Any], index: int = 0, size: tuple[int, ...] = _SIZE) -> np.ndarray:
    """A list of numbers as an array of bytes of the given shape."""
    return np.array(list(list_of_values)).reshape(size).astype(np.uint8)


def get_resized_images_array(images: Sequence[Image.Image], size: tuple[int, int] = (20, 20)) -> np.ndarray:
    return np.array([np.asarray(image.resize(size, Image.Resampling.LANCZOS)) for image in images])


def array_from_image(img: Image.Image, size: tuple[int, int] = (28, 28)) -> np.ndarray:
    """The pixels of an ``L`` image as bytes, shape (height, width) for a ``size`` of (width, height)."""
    return np.asarray(img.convert("L"), dtype=np.uint8).reshape(size[1], size[0])


def get_images_list_from_images_array(images_array: np.ndarray) -> list[Image.Image]:
    return [image_from_array(array) for array in images_array]


def image_from_array(arr: np.ndarray, mode: str = "L") -> Image.Image:
    return Image.fromarray(np.asarray(arr, dtype=np.uint8)).convert(mode)


def image_data_from_image(img: Image.Image) -> list[int]:
    """The pixels of an ``L`` image, row by row."""
    return [int(value) for value in np.asarray(img.convert("L")).ravel()]


def df_from_image(img: Image.Image, show: bool = False) -> pd.DataFrame:
    """A data frame with one cell a pixel."""
    return pd.DataFrame(np.asarray(img.convert("L")).astype(int))


def image_from_df(df: pd.DataFrame) -> Image.Image:
    return image_from_array(df.to_numpy())


def style_df(df: pd.DataFrame) -> None:
    """Shows colours in a notebook; nothing here."""


def zoom_img(img: Any, size: tuple[int, int] = (5, 5), grid: bool = True) -> None:
    """Shows an image enlarged in a notebook; nothing here."""


def raw_image_data_to_array(
    df: Any, index: int = 0, size: tuple[int, ...] = _SIZE, col: str = "vals"
) -> np.ndarray | None:
    """The numbers of row ``index`` of a data frame or list as an array of bytes."""
    if index >= len(df):
        print(f"There are only {len(df)} images: index {index} is too high.")
        return None
    values = df.iloc[index][col] if isinstance(df, pd.DataFrame) else df[index]
    numbers = values.split(",") if isinstance(values, str) else values
    return np.array([int(number) for number in numbers]).reshape(size).astype(np.uint8)


def collected_image(df: Any, index: int = 0, size: tuple[int, ...] = _SIZE) -> Image.Image | None:
    """The logged image in row ``index``, in colour."""
    array = raw_image_data_to_array(df, index, size)
    return None if array is None else Image.fromarray(array)


def generate_image(
    df: Any,
    index: int = 0,
    size: tuple[int, ...] = _SIZE,
    mode: str = "greyscale",
    crop: Box | None = None,
    resize: Any = None,
    fill: int = 255,
    threshold: int = 127,
) -> Image.Image:
    """The logged image in row ``index``: greyscale, ``bw``, or colour for any other mode; cropped, then resized."""
    image = collected_image(df, index, size)
    if image is None:
        raise IndexError(f"there is no image {index}")
    if mode == "greyscale":
        image = image.convert("L")
    elif mode == "bw":
        image = make_image_black_and_white(image, threshold)
    if crop is not None:
        image = image.crop(crop)
    if resize is not None:
        image = image.resize((size[0], size[1]) if resize == "auto" else resize, Image.Resampling.LANCZOS)
    return image


def make_image_black_and_white(img: Image.Image, threshold: int = 127) -> Image.Image:
    """White where the grey is above the threshold, black elsewhere (mode ``1``)."""
    return img.convert("L").point(lambda grey: 255 if grey > threshold else 0).convert("1")


def generate_bw_image(
    df: Any,
    index: int = 0,
    size: tuple[int, ...] = _SIZE,
    threshold: int = 127,
    crop: Box | None = None,
    resize: Any = None,
) -> Image.Image:
    return make_image_black_and_white(generate_image(df, index, size, "greyscale", crop, resize), threshold)


def generate_signature_from_series(row: Sequence[int], fill: int = 255) -> list[int]:
    """Transitions, first value, longest run of white, longest run of black."""
    values = [int(value) for value in row]
    longest = {True: 0, False: 0}
    transitions, run = 0, 0
    for place, value in enumerate(values):
        same = place > 0 and (value == fill) == (values[place - 1] == fill)
        run = run + 1 if same else 1
        transitions += place > 0 and not same
        white = value == fill
        longest[white] = max(longest[white], run)
    return [transitions, values[0], longest[True], longest[False]]


def generate_signature(
    img: Image.Image,
    threshold: int = 127,
    normalise: Any = None,
    linear: bool = False,
    segment: Any = None,
    fill: int = 255,
) -> Any:
    """Four numbers a row of the black-and-white image, as a data frame, or flat with ``linear``."""
    pixels = np.asarray(make_image_black_and_white(img, threshold).convert("L"))
    rows = [generate_signature_from_series(row, fill) for row in pixels]
    return [number for row in rows for number in row] if linear else pd.DataFrame(rows)


def get_image_from_state(csv: str, size: tuple[int, ...] = (20, 20, 4), mode: str = "RGB") -> Image.Image:
    """The image in a sensor's raw string, alpha included."""
    return Image.fromarray(image_data_to_array([int(number) for number in csv.split(",")], size=size)).convert(mode)


def preview_state_image(*_args: Any, **_kwargs: Any) -> None:
    """Shows an image in a notebook; nothing here."""


def _trimmed(pixels: np.ndarray, background: int) -> np.ndarray:
    inside = pixels != background
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not rows.size:
        return pixels
    return pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def background_column(column: Sequence[int], background: int = 255) -> bool:
    return all(int(value) == background for value in column)


def clear_columns(df: pd.DataFrame, background: int = 255) -> pd.DataFrame:
    """Without the uniform columns at either side."""
    keep = [place for place in range(df.shape[1]) if not background_column(df.iloc[:, place].tolist(), background)]
    return df.iloc[:, keep[0] : keep[-1] + 1] if keep else df


def trim_image(img: Any, background: int = 255) -> Any:
    """Without the rows and columns of background round the edge; a data frame stays one."""
    if isinstance(img, pd.DataFrame):
        return pd.DataFrame(_trimmed(img.to_numpy(), background))
    return image_from_array(_trimmed(np.asarray(img.convert("L")), background))


def crop_and_pad_to_fit(img: Image.Image, background: int = 255) -> Image.Image:
    """The trimmed image in the middle of a canvas of the old size."""
    trimmed = trim_image(img, background)
    canvas = Image.new("L", img.size, background)
    canvas.paste(trimmed, ((img.size[0] - trimmed.size[0]) // 2, (img.size[1] - trimmed.size[1]) // 2))
    return canvas


def crop_and_zoom_to_fit(img: Image.Image, background: int = 0) -> Image.Image:
    """The trimmed image enlarged to the old size."""
    zoomed: Image.Image = trim_image(img, background).resize(img.size, Image.Resampling.LANCZOS)
    return zoomed


def jiggle(img: Image.Image, background: int = 0, quiet: bool = True) -> Image.Image:
    """The trimmed image somewhere on a canvas of the old size."""
    trimmed = trim_image(img, background)
    canvas = Image.new("L", img.size, background)
    places = [random.randint(0, max(img.size[axis] - trimmed.size[axis], 0)) for axis in (0, 1)]
    canvas.paste(trimmed, (places[0], places[1]))
    return canvas


def get_image_features(img: Image.Image) -> list[int]:
    return image_data_from_image(img)


def get_images_features(images: Sequence[Image.Image], normalise: bool = True) -> Any:
    """One row of pixel values an image, of length 1 unless ``normalise`` is off."""
    rows = [get_image_features(image) for image in images]
    return _normalised(rows, "l2") if normalise else rows


def predict_from_image(MLP: Any, img: Image.Image) -> Any:
    return MLP.predict(_normalised([get_image_features(img)], "max"))[0]


def _normalised(rows: list[list[int]], norm: str) -> Any:
    # Not before it is needed: some assignments do without scikit-learn.
    from sklearn.preprocessing import normalize

    return normalize(rows, norm=norm)
