%%sim_magic_preloaded -b Loop
import math
import time

begin = None
end = None

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(100):
    turned = float(tank_drive.left_motor.position)
    light = colorLeft.reflected_light_intensity_pc
    now = str(get_clock())
    print("Wheel_left: " + str(turned) + " " + now)
    print("Light_left: " + str(light) + " " + now)
    # The sensor's middle is over the edge when it sees half of the light.
    if light < 50 and begin is None:
        begin = turned
    if light > 50 and begin is not None and end is None:
        end = turned
    time.sleep(0.05)

tank_drive.off()
width = (end - begin) / 360 * math.pi * 56
say("The track is " + str(round(width)) + " mm wide")
