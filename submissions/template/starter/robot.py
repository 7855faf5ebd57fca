%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800

# Drive forwards, stop when the left light sensor is over the red band, and say so.
tank_drive.on(SpeedPercent(20), SpeedPercent(20))
