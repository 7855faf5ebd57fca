%%sim_magic_preloaded
# Let the robot count aloud from 1 to 10.

count = 1

while count < 2:
    say(str(count))
    count = count + 1

# TODO: count to 10.
# TODO: let each number be finished before the next one begins.
