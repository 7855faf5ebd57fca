%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90
while True:
    left = colorLeft.reflected_light_intensity_pc
    right = colorRight.reflected_light_intensity_pc
    if left < 40 or right < 40:
        tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), 1)
        tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.9)
    else:
        tank_drive.on(SpeedPercent(40), SpeedPercent(40))
