%%sim_magic_preloaded -b WRO_2018_Regular_Junior -x 1180 -y 150 -a 90
# Turns the wrong way after the green area.
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 9.4)
tank_turn.on_for_rotations(100, SpeedPercent(40), 1)
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 9.4)
