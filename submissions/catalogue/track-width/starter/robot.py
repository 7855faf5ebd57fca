%%sim_magic_preloaded -b Loop
# Drive across the track and log the left wheel's position and the left light sensor, both with the time.

import time

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(10):
    print("Wheel_left: " + str(tank_drive.left_motor.position) + " " + str(get_clock()))
    # TODO: log the light as well.
    time.sleep(0.1)

tank_drive.off()

# TODO: where did black begin, where did it end?
say("The track is ? mm wide")
