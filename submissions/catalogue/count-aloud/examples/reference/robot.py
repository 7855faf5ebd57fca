%%sim_magic_preloaded
say("I am going to count", wait=True)

count = 1

while count <= 10:
    say(str(count), wait=True)
    count = count + 1
