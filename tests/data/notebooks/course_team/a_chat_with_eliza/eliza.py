"""A very small Eliza."""
import json
import re

import rules_of_eliza as rules


class Therapist:
    def __init__(self):
        self.heard = []

    def answer(self, text):
        self.heard.append(text)
        for pattern, reply in rules.RULES:
            match = re.match(pattern, text, re.IGNORECASE)
            if match:
                return reply.format(*match.groups())
        return "Go on"


def as_json(text):
    return json.dumps({"answer": text})
