%%sim_magic_preloaded -b Line_Following_Test
for guess in range(256):
    print("Reflected light: " + str(guess))
    print("Percent: " + str(round(guess / 2.55, 2)))
