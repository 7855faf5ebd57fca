%%sim_magic_preloaded -b Loop
# A fixed distance instead of the sensor.
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 6)
