%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800
say(str(colorLeft.color) + " " + colorLeft.color_name)
