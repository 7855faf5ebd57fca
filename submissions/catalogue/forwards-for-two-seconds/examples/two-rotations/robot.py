%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# Two rotations are not two seconds.
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
