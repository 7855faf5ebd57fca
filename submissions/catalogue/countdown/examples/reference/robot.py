%%sim_magic_preloaded
count = 10

while count >= 0:
    say(str(count), wait=True)
    count = count - 1

say("OK")
