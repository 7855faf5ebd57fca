%%sim_magic_preloaded
# Make the robot say the name of this module.

say("TM129")

# TODO: can you understand it? Spell the name so that the letters and digits are said one by one.
