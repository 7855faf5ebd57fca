%%sim_magic_preloaded -b Lollipop
for guess in range(0, 10001, 5):
    print("Light: " + str(guess / 100) + ", full: " + str(guess / 100))
