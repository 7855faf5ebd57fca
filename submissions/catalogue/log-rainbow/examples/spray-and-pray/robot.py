%%sim_magic_preloaded -b Rainbow_bands
import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

for sample in range(75):
    for guess in range(0, 101, 5):
        print("Light_left: " + str(guess))
    time.sleep(0.1)

tank_drive.off()
