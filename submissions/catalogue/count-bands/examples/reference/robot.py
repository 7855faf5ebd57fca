%%sim_magic_preloaded -b Grey_bands
count = 0

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

while count < 4:
    # White: wait for the next band.
    while colorLeft.reflected_light_intensity_pc == 100:
        pass
    count = count + 1
    say(str(count))
    # On the band: wait for its end, except at the last one.
    while count < 4 and colorLeft.reflected_light_intensity_pc < 100:
        pass

tank_drive.off()
