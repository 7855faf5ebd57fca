%%sim_magic_preloaded -b Square -p -x 550 -y 300
# The sides are too short: the robot cuts across the grey square.
for side in range(4):
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 4)
    tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.6)
