%%sim_magic_preloaded -b Sensor_Diameter_Test -r Sensor_Diameter_Config -x 200 -y 645
tank_drive.on(SpeedPercent(20), SpeedPercent(20))

red = False
while not red:
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))
    print("Light_right: " + str(colorRight.reflected_light_intensity_pc))
    r, g, b = colorRight.rgb
    red = r > g + 10

tank_drive.off()
