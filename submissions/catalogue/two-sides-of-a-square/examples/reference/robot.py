%%sim_magic_preloaded -p -x 500 -y 500
# The first side, and a turn
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
tank_turn.on_for_rotations(-100, SpeedPercent(75), 1.68)

# The second side, and a turn
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
tank_turn.on_for_rotations(-100, SpeedPercent(75), 1.68)
