"""The languages of the pages: every catalogue is complete, and each reader gets the chosen language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from service.language import SOURCE_LANGUAGE, list_languages
from service.message_catalogue import extract_messages, locate_catalogue, update_catalogue
from web import submit, web_in

OTHERS = [code for code in list_languages() if code != SOURCE_LANGUAGE]
_PLACES = re.compile(r"%\(\w+\)[\d.]*[a-z]|<[^>]+>")


@pytest.mark.parametrize("code", OTHERS)
def test_a_catalogue_has_all_that_pages_say(code: str) -> None:
    catalogue = update_catalogue(code)
    message_ids = {str(message.id) for message in extract_messages() if message.id}
    kept = {str(message.id): message.string for message in catalogue if message.id}
    assert message_ids == set(kept), (
        f"python -m service.message_catalogue brings {locate_catalogue(code).name} up to date"
    )
    missing = [text for text, translated in kept.items() if not translated or not all(translated)]
    assert missing == []
    for message in catalogue:
        if message.id and isinstance(message.id, str):
            assert sorted(_PLACES.findall(message.id)) == sorted(_PLACES.findall(str(message.string))), message.id


@pytest.mark.long
def test_a_reader_gets_the_language_they_ask_for(tmp_path: Path) -> None:
    with web_in(tmp_path) as web:
        nobody = web.browser()
        assert '<html lang="en">' in nobody.get("/sign-in").text
        german = nobody.get("/sign-in", headers={"accept-language": "fr;q=0.9, de-CH, en;q=0.8"}).text
        assert '<html lang="de">' in german
        assert "<h1>Anmelden</h1>" in german
        for header in ("", "x" * 5000, ";;,,", "../../etc", "*"):
            assert '<html lang="en">' in nobody.get("/sign-in", headers={"accept-language": header}).text
        grace = web.browser(web.instructor())
        answer = submit(grace, "/language", {"code": "de", "next": "//evil.example.org"})
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        assert '<html lang="de">' in grace.get("/account").text
        assert submit(grace, "/language", {"code": "../x"}).status_code == 422
