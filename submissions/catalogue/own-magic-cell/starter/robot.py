%%sim_magic
# Print a message of your own.
# TODO: add the flags to the line above.

print("")
