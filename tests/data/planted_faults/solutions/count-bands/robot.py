%%sim_magic_preloaded -b Grey_bands
bands = 0
on_band = False

tank_drive.on(SpeedPercent(30), SpeedPercent(30))
while bands < 4:
    light = colorLeft.reflected_light_intensity_pc
    if light < 95 and not on_band:
        on_band = True
        bands = bands + 1
        say(str(bands))
    if light == 100:
        on_band = False
tank_drive.off()
