%%sim_magic_preloaded -b Sensor_Diameter_Test -r Sensor_Diameter_Config -x 200 -y 645
tank_drive.on(SpeedPercent(20), SpeedPercent(20))

for sample in range(250):
    light = colorLeft.reflected_light_intensity_pc
    print("Light_left: " + str(light))
    print("Light_right: " + str(light))
    light = colorLeft.reflected_light_intensity_pc
    light = colorLeft.reflected_light_intensity_pc

tank_drive.off()
