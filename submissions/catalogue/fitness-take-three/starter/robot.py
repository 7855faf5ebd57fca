%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
"""Out by d and back, out by twice d and back, out by d and back."""

DISTANCE = 2

# TODO: three excursions.
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), DISTANCE)
tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), DISTANCE)
