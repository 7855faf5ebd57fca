%%sim_magic_preloaded -b Grey_bands
count = 0

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# A band is counted when the robot has left it, so the number comes late.
while count < 4:
    while colorLeft.reflected_light_intensity_pc == 100:
        pass
    while colorLeft.reflected_light_intensity_pc < 100:
        pass
    count = count + 1
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 1)
    say(str(count))
    tank_drive.on(SpeedPercent(40), SpeedPercent(40))

tank_drive.off()
