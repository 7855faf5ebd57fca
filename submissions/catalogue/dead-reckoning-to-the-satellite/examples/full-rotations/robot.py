%%sim_magic_preloaded -b FLL_2018_Into_Orbit -r Small_Robot -x 150 -y 150 -a 90 -p
# One rotation taken for the whole circumference: everything is half as far.
tank_turn.on_for_rotations(100, SpeedPercent(5), 93 / 112)
tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), 1000 / 88)
tank_turn.on_for_rotations(-100, SpeedPercent(5), 77 / 112)
tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), 325 / 88)
