%%sim_magic_preloaded -b Lollipop
SPEED = 10
GAIN = 0.15
EDGE = 105  # between the black line (0) and the grey floor (211)

red, green, blue = colorLeft.rgb

# Go on until the sensor sees red: much red and little green. (Yellow has as much green as red.)
while not (red > 240 and green < 20):
    # Follow the left edge of the line: too light, turn right; too dark, turn left.
    steering = GAIN * (red - EDGE)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
    red, green, blue = colorLeft.rgb

tank_drive.off()
say("Arrived at the red end")
