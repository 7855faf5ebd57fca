%%sim_magic_preloaded -b Sensor_Diameter_Test -r Sensor_Diameter_Config -x 200 -y 645
import time

# At this speed there is a sample every 50 mm: most lines lie in between.
tank_drive.on(SpeedPercent(50), SpeedPercent(50))

for sample in range(15):
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))
    print("Light_right: " + str(colorRight.reflected_light_intensity_pc))
    time.sleep(0.2)

tank_drive.off()
