%%sim_magic_preloaded
count = 1

# Without wait=True all numbers are said at the same moment.
while count <= 10:
    say(str(count))
    count = count + 1
