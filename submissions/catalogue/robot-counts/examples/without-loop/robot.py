%%sim_magic_preloaded
say("1 2 3 4 5")
say("10 20 30 40 50 60 70 80 90 100")
