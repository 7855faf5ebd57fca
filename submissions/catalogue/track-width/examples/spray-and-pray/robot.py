%%sim_magic_preloaded -b Loop
import time

tank_drive.on(SpeedPercent(20), SpeedPercent(20))
for sample in range(100):
    now = str(get_clock())
    for guess in range(0, 101, 5):
        print("Light_left: " + str(guess) + " " + now)
        print("Wheel_left: " + str(8 * guess) + " " + now)
    time.sleep(0.05)
tank_drive.off()
for width in range(200):
    say("The track is " + str(width) + " mm wide")
