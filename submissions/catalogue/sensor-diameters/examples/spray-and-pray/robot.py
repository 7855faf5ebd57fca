%%sim_magic_preloaded -b Sensor_Diameter_Test -r Sensor_Diameter_Config -x 200 -y 645
import time

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(130):
    for guess in range(0, 101, 5):
        print("Light_left: " + str(guess))
        print("Light_right: " + str(guess))
    time.sleep(0.05)

tank_drive.off()
