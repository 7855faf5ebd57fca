%%sim_magic_preloaded
count = 1

while count < 10:
    say(str(count), wait=True)
    count = count + 1
