say("I see grey")
