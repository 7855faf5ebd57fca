%%sim_magic_preloaded -p -x 200 -y 500
def draw_square(side):
    for _ in range(4):
        tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), side)
        tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.6)


draw_square(2)
draw_square(4)
