%%sim_magic_preloaded -b WRO_2018_Regular_Junior -x 1180 -y 150 -a 90
"""Drive to a coloured target area, and on to a second one, by wheel positions and gyro."""
import time

MM_PER_DEGREE = 0.4887  # of the left wheel


def forwards(mm):
    """Drive straight ahead by this distance in mm, measured by the left wheel's position."""
    start = int(tank_drive.left_motor.position)
    tank_drive.on(SpeedPercent(40), SpeedPercent(40))
    while (int(tank_drive.left_motor.position) - start) * MM_PER_DEGREE < mm:
        time.sleep(0.05)
    tank_drive.off()


# TODO: drive to the first target, turn until the gyro says that it is enough, drive to the second.
forwards(100)
