%%sim_magic_preloaded -b Grey_bands
for shade in ("light", "medium", "dark", "black"):
    say(shade)
