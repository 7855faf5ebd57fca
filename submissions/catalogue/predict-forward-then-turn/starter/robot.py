%%sim_magic_preloaded -b Empty_Map -x 100 -y 800
"""Predict the second move, then make both."""

# TODO: what is your prediction: left, right or straight?
print("I predict: ...")

# Forwards for a second
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 1)

# TODO: the left wheel forwards and the right wheel backwards for a second.
