%%sim_magic_preloaded -b Square -p -x 550 -y 300
SIDES = 4
STEERING = -100
TURN_ROTATIONS = 1.6
SIDE_ROTATIONS = 6
SPEED = SpeedPercent(40)

for side in range(SIDES):
    tank_drive.on_for_rotations(SPEED, SPEED, SIDE_ROTATIONS)
    tank_turn.on_for_rotations(STEERING, SPEED, TURN_ROTATIONS)
