"""``%sim_data`` and related magics: the robot's logged data and its last position, for use in a notebook.

The magics that start the robot are not here; they are the worker's.
"""

from __future__ import annotations

import random
from typing import Any

import pandas as pd

from nbev3devsim.load_nbev3devwidget import roboSim
from nn_tools.sensor_data import generate_bw_image, get_sensor_image_pair


class RobotState:
    """The robot's current state in the simulator, as ``state``."""

    def __init__(self, state: dict[str, Any]) -> None:
        self.state = dict(state)


def sim_data(words: list[str]) -> pd.DataFrame | None:
    """Return the datalog as a long table. ``--clear`` empties it and the image log."""
    if "-c" in words or "--clear" in words:
        roboSim.clear_datalog()
        return None
    log = roboSim.results_log
    if not log:
        return pd.DataFrame()
    rows = [
        (record["index"], record["simtime"], name, value)
        for record in log
        for name, value in record.items()
        if name not in ("index", "simtime")
    ]
    if any(simtime is not None for _, simtime, _, _ in rows):
        timed = [(simtime, name, value) for _, simtime, name, value in rows if simtime is not None]
        return pd.DataFrame(timed, columns=["time", "variable", "value"])
    first = rows[0][0]
    since = [(moment - first, name, value, (moment - first).total_seconds()) for moment, _, name, value in rows]
    return pd.DataFrame(since, columns=["index", "variable", "value", "time"])


def sim_robot_state(words: list[str]) -> RobotState:
    if not roboSim.robot_state:
        roboSim.robot_state = roboSim.look()
    return RobotState(roboSim.robot_state)


def sim_bw_image_data(words: list[str]) -> Any:
    """Return a logged image in black and white: ``-i index``, ``-t threshold``, ``-c x1,y1,x2,y2``, ``-n`` (whole)."""
    df = roboSim.image_data()
    if "-r" in words or "--random" in words:
        index = random.randrange(len(df))
    else:
        index = int(_find_option(words, "-i", "--index", "-1"))
    crop = tuple(int(number) for number in _find_option(words, "-c", "--crop", "3,3,17,17").split(","))
    whole = "-n" in words or "--nocrop" in words
    threshold = int(_find_option(words, "-t", "--threshold", "127"))
    return generate_bw_image(df, index % max(len(df), 1), threshold=threshold, crop=None if whole else crop)


def sim_image_pair(words: list[str]) -> Any:
    """Return the left and the right image of a logged pair: ``-p index``."""
    return get_sensor_image_pair(roboSim.image_data(), int(_find_option(words, "-p", "--pair", "-1")))


def _find_option(words: list[str], short: str, long: str, default: str) -> str:
    for place, word in enumerate(words):
        if word in (short, long) and place + 1 < len(words):
            return words[place + 1]
        if word.startswith(f"{long}="):
            return word.partition("=")[2]
    return default


MAGICS = {
    "sim_data": sim_data,
    "sim_robot_state": sim_robot_state,
    "sim_bw_image_data": sim_bw_image_data,
    "sim_image_pair": sim_image_pair,
}
