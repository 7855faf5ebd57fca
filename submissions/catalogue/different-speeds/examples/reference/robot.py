%%sim_magic_preloaded -b Empty_Map -x 100 -y 800 -a 180
import time


def case(left, right):
    """Drive for a second, then stand until the wheels have forgotten their speed."""
    tank_drive.on_for_seconds(SpeedPercent(left), SpeedPercent(right), 1)
    # The wheels keep their speed when they stop; ask for none, and they slow down.
    tank_drive.on(SpeedPercent(0), SpeedPercent(0))
    time.sleep(1)
    tank_drive.off()
    time.sleep(0.5)


case(50, 20)
case(20, 50)
case(-50, -50)
case(40, -40)
