%%sim_magic_preloaded -b Loop
import time

begin = None
end = None

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(55):
    turned = float(tank_drive.left_motor.position)
    light = colorLeft.reflected_light_intensity_pc
    print("Wheel_left: " + str(turned))
    print("Light_left: " + str(light))
    if light < 50 and begin is None:
        begin = turned
    if light > 50 and begin is not None and end is None:
        end = turned
    time.sleep(0.1)

tank_drive.off()
# Degrees of the wheel, not millimetres.
say("The track is " + str(round(end - begin)) + " mm wide")
