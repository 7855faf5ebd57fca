%%sim_magic_preloaded -b Lollipop
SPEED = 14
GAIN = 0.15
EDGE = 105  # between the black line (0) and the grey floor (211)

red, green, blue = colorLeft.rgb

# An exact test, which noise never lets come true.
while not (red == 255 and green == 0 and blue == 0):
    # Follow the left edge of the line: too light, turn right; too dark, turn left.
    steering = GAIN * (red - EDGE)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
    red, green, blue = colorLeft.rgb

tank_drive.off()
say("Arrived at the red end")
