"""Conversion of light sensor values to images, and the course's image processing.

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


def load_MNIST_images_array(fn: str = "mnist_batch_0.png") -> np.ndarray:
    """Return a vertical strip of 28 x 28 images as an array (n, 28, 28)."""
    return np.asarray(Image.open(fn).convert("L")).reshape(-1, 28, 28)


def load_MNIST_labels(fn: str = "labels.txt") -> list[int]:
    labels: list[int] = json.loads(Path(fn).read_text())
    return labels


def load_MNIST_images_and_labels(
    images_file: str = "mnist_batch_0.png", labels_file: str = "labels.txt", images: bool = True
) -> tuple[Any, list[int]]:
    """Return images (a list, or an array with ``images=False``) and their labels."""
    array = load_MNIST_images_array(images_file)
    return (get_images_list_from_images_array(array) if images else array), load_MNIST_labels(labels_file)


def report_light_sensor(state: Any, side: str = "left") -> None:
    """Print the simulator's values of one light sensor."""
    values = getattr(state, "state", state)
    print(
        f"{side.capitalize()} light sensor:",
        f"raw {values.get(f'{side}_light_raw')}, R {values.get(f'{side}_light')},",
        f"R% {values.get(f'{side}_light_pc')}, full% {values.get(f'{side}_light_full')}",
    )


def sensor_image_focus(img: Image.Image, centre: Box = _FOCUS, resize: Any = None, bw: bool = False) -> Image.Image:
    """Return the part of a sensor image inside the round window: 14 x 14 pixels by default."""
    size = img.size
    img = img.crop(centre)
    if resize is not None:
        img = img.resize(size if resize == "auto" else resize, Image.Resampling.LANCZOS)
    return make_image_black_and_white(img) if bw else img


def get_sensor_image_pair(
    image_data: pd.DataFrame, index: int | None = None, mode: str = "greyscale", threshold: int = 127
) -> tuple[Image.Image, Image.Image] | None:
    """Return the left and the right focus image of pair ``index`` (rows 2i and 2i+1), -1 for the last pair."""
    if image_data.empty:
        return None
    if index is None or index == -1:
        if len(image_data) < 2:
            raise TypeError("an image pair needs two rows, left and right")
        first = len(image_data) - 2
    else:
        first = 2 * index
    left, right = (sensor_image_focus(generate_image(image_data, row)) for row in (first, first + 1))
    if mode == "bw":
        return make_image_black_and_white(left, threshold), make_image_black_and_white(right, threshold)
    return left, right


def get_random_image(
    images_array: Any, labels: Sequence[Any] | None = None, show: bool = False, index: int | None = None
) -> tuple[Image.Image, Any]:
    """Return an image and its label from a list or an array of images, at random unless ``index`` is given."""
    place = random.randrange(len(images_array)) if index is None else index
    label = None if labels is None else labels[place]
    if show:
        print(f"Image label: {label}")
    return as_image(images_array[place]), label


def as_image(image: Any) -> Image.Image:
    """Return an image unchanged, or convert an array to a greyscale image."""
    return image if isinstance(image, Image.Image) else image_from_array(image)


def image_data_to_array(image_data: Sequence[Any], index: int = 0, size: tuple[int, ...] = _SIZE) -> np.ndarray:
    """Return a list of numbers as an array of bytes with the given shape."""
    return np.array(list(image_data)).reshape(size).astype(np.uint8)


def get_resized_images_array(images_array: Any, size: tuple[int, int] = (20, 20)) -> np.ndarray:
    return np.array([np.asarray(as_image(image).resize(size, Image.Resampling.LANCZOS)) for image in images_array])


def array_from_image(img: Image.Image, size: tuple[int, int] = (28, 28)) -> np.ndarray:
    """Return the pixels of an ``L`` image as bytes, shape (height, width) for a ``size`` of (width, height)."""
    return np.asarray(img.convert("L"), dtype=np.uint8).reshape(size[1], size[0])


def get_images_list_from_images_array(images_array: np.ndarray) -> list[Image.Image]:
    return [image_from_array(array) for array in images_array]


def image_from_array(image_array: np.ndarray, mode: str = "L") -> Image.Image:
    return Image.fromarray(np.asarray(image_array, dtype=np.uint8)).convert(mode)


def image_data_from_image(img: Image.Image) -> list[int]:
    """Return the pixels of an ``L`` image, row by row."""
    return [int(value) for value in np.asarray(img.convert("L")).ravel()]


def df_from_image(img: Image.Image, show: bool = True, colorTheme: str = "Blues") -> pd.DataFrame:
    """Return a data frame with one cell for each pixel."""
    return pd.DataFrame(np.asarray(img.convert("L")).astype(int))


def image_from_df(df: Any) -> Image.Image:
    """Return the image of a data frame of pixels. An image is returned unchanged."""
    return as_image(df.to_numpy() if isinstance(df, pd.DataFrame) else df)


def style_df(df: pd.DataFrame, bw: bool = False, colorTheme: str = "Blues", threshold: int = 127) -> None:
    """Placeholder for a function that shows colours in a notebook."""


def zoom_img(img: Any, size: tuple[int, int] = (5, 5), grid: bool = True) -> None:
    """Placeholder for a function that enlarges an image in a notebook."""


def raw_image_data_to_array(
    tmp: Any, index: int = 0, size: tuple[int, ...] = _SIZE, col: str = "vals"
) -> np.ndarray | None:
    """Return the numbers of row ``index`` of a data frame or list as an array of bytes."""
    if index >= len(tmp):
        print(f"There are only {len(tmp)} images: index {index} is too high.")
        return None
    values = tmp.iloc[index][col] if isinstance(tmp, pd.DataFrame) else tmp[index]
    numbers = values.split(",") if isinstance(values, str) else values
    return np.array([int(number) for number in numbers]).reshape(size).astype(np.uint8)


def collected_image(df: Any, index: int = 0, size: tuple[int, ...] = _SIZE) -> Image.Image | None:
    """Return the logged image in row ``index``, in colour."""
    array = raw_image_data_to_array(df, index, size)
    return None if array is None else Image.fromarray(array)


def generate_image(
    image_data_df: Any,
    index: int = 0,
    size: tuple[int, ...] = _SIZE,
    mode: str = "greyscale",
    crop: Box | None = None,
    resize: Any = None,
    fill: int = 255,
    threshold: int = 127,
) -> Image.Image:
    """Return the logged image in row ``index``: greyscale, ``bw``, or else colour; cropped, then resized."""
    image = collected_image(image_data_df, index, size)
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
    """Return the image in mode ``1``: white if the grey level is above the threshold, otherwise black."""
    return img.convert("L").point(lambda grey: 255 if grey > threshold else 0).convert("1")


def generate_bw_image(
    image_data: Any,
    index: int = 0,
    size: tuple[int, ...] = _SIZE,
    threshold: int = 127,
    crop: Box | None = None,
    resize: Any = None,
) -> Image.Image:
    return make_image_black_and_white(generate_image(image_data, index, size, "greyscale", crop, resize), threshold)


def generate_signature_from_series(
    s: Sequence[int], fill: int = 255, threshold: int = 127, binarise: bool = False
) -> list[int]:
    """Return the transitions, first value, longest run of white, and longest run of black."""
    values = [int(value) for value in s]
    if binarise:
        values = [255 if value > threshold else 0 for value in values]
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
    img: Any,
    threshold: int | None = 127,
    normalise: Any = None,
    linear: bool = False,
    segment: Any = None,
    fill: int = 255,
    show: bool = False,
) -> Any:
    """Return four numbers for each row of the black-and-white image, as a data frame, or flat with ``linear``.

    ``segment`` is a row, or rows, to leave out; of a flat one ``normalise`` makes a row of length 1.
    """
    if isinstance(img, Image.Image):
        image = img if threshold is None else make_image_black_and_white(img, threshold)
        pixels = np.asarray(image.convert("L"))
    else:
        pixels = np.asarray(img)
    if segment:
        pixels = np.delete(pixels, segment, axis=0)
    rows = [generate_signature_from_series(row, fill) for row in pixels]
    if not linear:
        return pd.DataFrame(rows)
    flat = [number for row in rows for number in row]
    return _normalise_rows([flat], "l2") if normalise else flat


def get_image_from_state(
    data: str, size: tuple[int, ...] = (20, 20, 4), mode: str = "RGB", zoom: bool = True
) -> Image.Image:
    """Return the image in a sensor's raw string, including alpha."""
    return Image.fromarray(image_data_to_array([int(number) for number in data.split(",")], size=size)).convert(mode)


def preview_state_image(
    data: str, size: tuple[int, ...] = (20, 20, 4), mode: str = "RGB", zoom: bool = True, retval: bool = True
) -> Image.Image | None:
    """Return the image in a sensor's raw string, or None without ``retval``. Shows nothing."""
    return get_image_from_state(data, size, mode) if retval else None


def background_column(s: Sequence[int], background: int = 255, threshold: Any = None) -> bool:
    return all(int(value) == background for value in s)


def clear_columns(
    df: pd.DataFrame, reverse: bool = False, transpose: bool = False, background: int = 255, threshold: Any = None
) -> pd.DataFrame:
    """Remove background columns at the left; at the right with ``reverse``; rows with ``transpose``."""
    table = df.T if transpose else df
    inside = np.flatnonzero((table.to_numpy() != background).any(axis=0))
    if inside.size:
        table = table.iloc[:, : inside[-1] + 1] if reverse else table.iloc[:, inside[0] :]
    return table.T if transpose else table


def trim_image(
    bw_df: Any,
    background: int = 255,
    reindex: bool = False,
    show: bool = True,
    colorTheme: str = "Blues",
    image: bool = False,
    threshold: Any = False,
) -> Any:
    """Return the image without background rows and columns at the edges.

    Of an image an image; of a data frame one, with the old names of its rows and columns unless ``reindex``, or an
    image if that is asked for.
    """
    table = bw_df if isinstance(bw_df, pd.DataFrame) else df_from_image(bw_df)
    for reverse in (False, True):
        for transpose in (False, True):
            table = clear_columns(table, reverse, transpose, background)
    if image or not isinstance(bw_df, pd.DataFrame):
        return image_from_df(table)
    return pd.DataFrame(table.to_numpy()) if reindex else table.copy()


def crop_and_pad_to_fit(
    img: Image.Image, background: int = 255, scale: float = 1, quiet: bool = True, threshold: Any = None
) -> Image.Image:
    """Return the trimmed image in the middle of a canvas of the old size."""
    trimmed = trim_image(img, background)
    canvas = Image.new("L", img.size, background)
    canvas.paste(trimmed, ((img.size[0] - trimmed.size[0]) // 2, (img.size[1] - trimmed.size[1]) // 2))
    return canvas


def crop_and_zoom_to_fit(img: Image.Image, background: int = 0, scale: float = 1, quiet: bool = True) -> Image.Image:
    """Return the trimmed image enlarged to the old size."""
    zoomed: Image.Image = trim_image(img, background).resize(img.size, Image.Resampling.LANCZOS)
    return zoomed


def jiggle(img: Image.Image, background: int = 0, quiet: bool = True) -> Image.Image:
    """Return the trimmed image at a random position on a canvas of the old size."""
    trimmed = trim_image(img, background)
    canvas = Image.new("L", img.size, background)
    places = [random.randint(0, max(img.size[axis] - trimmed.size[axis], 0)) for axis in (0, 1)]
    canvas.paste(trimmed, (places[0], places[1]))
    return canvas


def get_image_features(image: Image.Image) -> list[int]:
    return image_data_from_image(image)


def get_images_features(images_list: Sequence[Image.Image], normalise: bool = True) -> Any:
    """Return one row of pixel values for each image, with length 1 unless ``normalise`` is false."""
    rows = [get_image_features(image) for image in images_list]
    return _normalise_rows(rows, "l2") if normalise else rows


def predict_from_image(MLP: Any, _image_image: Image.Image) -> Any:
    return MLP.predict(_normalise_rows([get_image_features(_image_image)], "max"))[0]


def _normalise_rows(rows: list[list[int]], norm: str) -> Any:
    # Not before it is needed: some assignments do without scikit-learn.
    from sklearn.preprocessing import normalize

    return normalize(rows, norm=norm)
