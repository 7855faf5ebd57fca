%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
tank_turn.on_for_rotations(100, SpeedPercent(75), 2)
