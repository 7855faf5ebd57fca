%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800

tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), 0.5)
say("red")
