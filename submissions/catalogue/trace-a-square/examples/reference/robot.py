%%sim_magic_preloaded -b Empty_Map -p
SIDES = 4
SIDE_ROTATIONS = 1
TURN_ROTATIONS = 1.6
SPEED = SpeedPercent(40)

for side in range(SIDES):
    tank_drive.on_for_rotations(SPEED, SPEED, SIDE_ROTATIONS)
    tank_turn.on_for_rotations(-100, SPEED, TURN_ROTATIONS)
