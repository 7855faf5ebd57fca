%%sim_magic_preloaded -p -x 200 -y 500
def draw_square(side, turn=1.6, speed=40):
    """Draw a square; side and turn are in rotations of the wheels."""
    for _ in range(4):
        tank_drive.on_for_rotations(SpeedPercent(speed), SpeedPercent(speed), side)
        tank_turn.on_for_rotations(-100, SpeedPercent(speed), turn)


for rotations in [1.5, 2, 3]:
    draw_square(rotations)
