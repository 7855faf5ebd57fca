%%sim_magic_preloaded -b Grey_bands
# Drive across the bands and count them aloud; end after the fourth.

count = 0

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# TODO: when does a band begin, when does it end?
while count < 1:
    if colorLeft.reflected_light_intensity_pc < 100:
        count = count + 1
        say(str(count))
