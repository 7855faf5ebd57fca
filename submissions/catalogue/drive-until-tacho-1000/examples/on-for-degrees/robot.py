%%sim_magic_preloaded -b Empty_Map
# Moves only half as far as the position says.
tank_drive.on_for_degrees(SpeedPercent(50), SpeedPercent(50), 1000)
