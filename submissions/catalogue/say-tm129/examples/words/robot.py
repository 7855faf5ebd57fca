%%sim_magic_preloaded
for part in ["tee", "em", "one", "two", "nine"]:
    say(part, wait=True)
