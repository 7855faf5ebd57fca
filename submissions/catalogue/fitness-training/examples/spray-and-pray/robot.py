%%sim_magic_preloaded -b Empty_Map
for first in range(5, 0, -1):
    for number in (1, 2, 3, 4, 5) * 2:
        say(str((number + first) % 5 + 1))
for number in (1, 2, 3, 4, 5) * 3:
    say(str(number))
