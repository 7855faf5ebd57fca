%%sim_magic_preloaded -b FLL_2018_Into_Orbit -r Small_Robot -x 1250 -y 450 -a 90
import math

START_X, START_Y, START_HEADING = 1250, 450, 90
TARGET_X, TARGET_Y = 2150, 950
MM_PER_ROTATION = 44  # half of the wheels' circumference, 88 mm
DEGREES_PER_ROTATION = 56


def forwards(mm):
    tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), mm / MM_PER_ROTATION)


def turn_left(degrees):
    tank_turn.on_for_rotations(-100, SpeedPercent(5), degrees / DEGREES_PER_ROTATION)


def turn_right(degrees):
    tank_turn.on_for_rotations(100, SpeedPercent(5), degrees / DEGREES_PER_ROTATION)


bearing = math.degrees(math.atan2(TARGET_Y - START_Y, TARGET_X - START_X))
distance = math.hypot(TARGET_X - START_X, TARGET_Y - START_Y)
turn_right(START_HEADING - bearing)
forwards(distance)
