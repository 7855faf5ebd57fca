%%sim_magic_preloaded
# range(10, 0, -1) ends at 1.
for count in range(10, 0, -1):
    say(str(count), wait=True)

say("OK")
