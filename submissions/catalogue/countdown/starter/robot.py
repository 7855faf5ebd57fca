%%sim_magic_preloaded
# Count down aloud from 10 to 0, then say "OK".

for count in [3, 2, 1]:
    say(str(count))

# TODO: begin at 10, end at 0, then "OK".
