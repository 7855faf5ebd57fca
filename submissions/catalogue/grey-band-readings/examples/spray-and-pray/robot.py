%%sim_magic_preloaded -b Grey_bands
for guess in range(256):
    print("Percent: " + str(round(guess / 2.55, 2)))
    print("rgb: " + str((guess, guess, guess)))
