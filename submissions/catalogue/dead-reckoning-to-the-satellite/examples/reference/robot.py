%%sim_magic_preloaded -b FLL_2018_Into_Orbit -r Small_Robot -x 150 -y 150 -a 90 -p
MM_PER_ROTATION = 44  # half of the wheels' circumference, 88 mm
DEGREES_PER_ROTATION = 56


def forwards(mm):
    tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), mm / MM_PER_ROTATION)


def turn_left(degrees):
    tank_turn.on_for_rotations(-100, SpeedPercent(5), degrees / DEGREES_PER_ROTATION)


def turn_right(degrees):
    tank_turn.on_for_rotations(100, SpeedPercent(5), degrees / DEGREES_PER_ROTATION)


# Along the lower edge of the mat, below the stem of the T
turn_right(93)
forwards(1000)

# Up to the satellite
turn_left(77)
forwards(325)
