%%sim_magic_preloaded -b Grey_bands -y 850
"""Drive across the bands, and stop on the red circle."""

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

# TODO: wait until a light sensor sees red. Which reading tells red from white, from grey and from black?

tank_drive.off()
