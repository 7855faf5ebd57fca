for number in range(40):
    print("PY::What does it see?")
    say("I see grey")
    say("I see black")
