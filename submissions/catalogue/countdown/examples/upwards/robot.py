%%sim_magic_preloaded
for count in range(11):
    say(str(count), wait=True)

say("OK")
