import no_such_module


def responder(text):
    return no_such_module.answer(text)
