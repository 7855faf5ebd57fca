%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
SPEED = 10

while True:
    left = colorLeft.reflected_light_intensity_pc
    right = colorRight.reflected_light_intensity_pc
    difference = left - right
    tank_drive.on(SpeedPercent(SPEED + difference / 2.5), SpeedPercent(SPEED - difference / 2.5))
