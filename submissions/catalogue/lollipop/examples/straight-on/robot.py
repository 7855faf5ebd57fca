%%sim_magic_preloaded -b Lollipop
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 4)
