%%sim_magic_preloaded
for count in range(1, 6):
    say(str(count))

for count in range(10, 101, 10):
    say(str(count))
