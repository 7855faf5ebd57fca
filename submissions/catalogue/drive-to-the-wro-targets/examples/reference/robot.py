%%sim_magic_preloaded -b WRO_2018_Regular_Junior -x 1180 -y 150 -a 90
import time

MM_PER_DEGREE = 0.4887  # of the left wheel


def stand():
    """Let the wheels forget their speed."""
    tank_drive.on(SpeedPercent(0), SpeedPercent(0))
    time.sleep(1)
    tank_drive.off()


def forwards(mm):
    start = int(tank_drive.left_motor.position)
    tank_drive.on(SpeedPercent(40), SpeedPercent(40))
    while (int(tank_drive.left_motor.position) - start) * MM_PER_DEGREE < mm - 100:
        time.sleep(0.05)
    stand()


def turn_left(degrees):
    start = gyro.angle
    tank_drive.on(SpeedPercent(-10), SpeedPercent(10))
    # The gyro counts clockwise.
    while start - gyro.angle < degrees - 6:
        pass
    stand()


# Straight up to the green area, then back down to the left, to the yellow one
forwards(830)
turn_left(115)
forwards(900)
