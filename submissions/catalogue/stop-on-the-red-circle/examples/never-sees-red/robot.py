%%sim_magic_preloaded -b Grey_bands -y 850
# Only the red part of the light is read: on the circle it is the same as on white, so the black band stops the robot.
tank_drive.on(SpeedPercent(50), SpeedPercent(50))
while colorLeft.reflected_light_intensity > 50:
    pass
tank_drive.off()
