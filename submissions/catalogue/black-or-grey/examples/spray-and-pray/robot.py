%%sim_magic_preloaded -b Grey_bands
for shade in ("grey", "black"):
    say(shade)
