%%sim_magic_preloaded -b Coloured_bands
for number, name in enumerate(("Black", "Blue", "Green", "Yellow", "Red", "White", "Brown"), 1):
    say(str(number) + " is " + name)
