OPENERS = ["I am a robot", "my wheels turn"]
