%%sim_magic_preloaded -b Lollipop
speed = 14

while True:
    red, green, blue = colorLeft.rgb
    if red > 220 and green < 35:
        break
    turn = (red - 105) / 7
    tank_drive.on(SpeedPercent(speed + turn), SpeedPercent(speed - turn))
tank_drive.off()
say("I am there")
