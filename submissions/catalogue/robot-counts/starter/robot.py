%%sim_magic_preloaded
# Let the robot count aloud from 1 to 5, and then from 10 to 100 in tens.

for count in [1]:
    say(str(count))

# TODO: count to 5.
# TODO: count in tens.
