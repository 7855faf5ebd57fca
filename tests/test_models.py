"""The classifiers that Robomark brings: their bytes can be made again, and they are as good as their card says."""

from __future__ import annotations

from pathlib import Path

import pytest

from models import Card, card, names, weights_bytes
from models.evaluation import evaluate
from models.shapes import CLASSES
from models.training import train
from sim.errors import UsageError


def test_training_again_gives_the_packaged_bytes(tmp_path: Path) -> None:
    about = train("shapes", tmp_path)
    assert (tmp_path / about.file).read_bytes() == weights_bytes("shapes")
    assert about == card("shapes")


def test_the_card_says_what_is_measured() -> None:
    result = evaluate("shapes")
    assert result.conditions == result.card.conditions
    assert result.confusion == result.card.confusion
    assert len(result.card.classes) == len(CLASSES) == 6


def test_the_shapes_are_told_apart_on_the_spot_and_beside_it() -> None:
    shares = {condition.name: condition.right / condition.n for condition in card("shapes").conditions}
    assert shares["light noise 0, on the spot"] == 1
    assert shares["light noise 64, on the spot"] == 1
    assert shares["light noise 128, on the spot"] > 0.95
    assert shares["1 mm off, light noise 0"] == shares["2 mm off, light noise 0"] == 1


@pytest.mark.parametrize("name", names())
def test_a_card_survives_its_file(name: str) -> None:
    assert Card.from_json(card(name).to_json()) == card(name)


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(UsageError, match="no model called 'shape'; expected one of shapes"):
        weights_bytes("shape")
