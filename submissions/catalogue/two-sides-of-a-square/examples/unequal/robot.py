%%sim_magic_preloaded -p -x 500 -y 500
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)
tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.6)
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 3)
