%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
# Without looking
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 12)
