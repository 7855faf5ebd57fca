%%sim_magic_preloaded -b Sensor_Diameter_Test -r Sensor_Diameter_Config -x 200 -y 645
# Drive across the black lines and log both light sensors.

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(20):
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))

# TODO: log the right sensor as well.
# TODO: go on until the robot has crossed the black lines.
