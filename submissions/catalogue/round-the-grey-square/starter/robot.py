%%sim_magic_preloaded -b Square -p -x 550 -y 300
"""Drive once round the grey square without touching it or the outline."""

SIDES = 4

# TODO: a side and a turn, as often as there are sides.
