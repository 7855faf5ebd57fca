%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90
while True:
    tank_drive.on(SpeedPercent(40), SpeedPercent(40))

    # Drive on until the border comes under the left or the right light sensor.
    while colorLeft.reflected_light_intensity_pc > 40 and colorRight.reflected_light_intensity_pc > 40:
        pass

    # Back off, then turn by a bit more than a right angle.
    tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), 1)
    tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.9)
