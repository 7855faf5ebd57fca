%%sim_magic_preloaded -b Grey_bands -y 850
tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# Red has much red in it and little green; white and grey have as much of both.
red, green, blue = colorLeft.rgb
while not (red > 200 and green < 50):
    red, green, blue = colorLeft.rgb

tank_drive.off()
