TEXTS = ["PY::0", "PY::[1, 2, 3]", 'PY::{"key": "value"}', "PY::my message"]


def responder(text):
    for each in [*TEXTS, *(f"PY::{number}" for number in range(60))]:
        agent(each)
        logger(each, "JSON::{}")
    return "JSON::" + str(TEXTS)
