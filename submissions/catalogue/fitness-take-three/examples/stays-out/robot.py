%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# The last time it stays where it is.
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)
tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), 2)
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 4)
tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), 4)
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)
