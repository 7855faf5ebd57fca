%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# The last time it stays where it is.
for exercise in range(1, 6):
    tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
    if exercise < 5:
        tank_drive.on_for_rotations(SpeedPercent(-50), SpeedPercent(-50), 2)
    say(str(exercise))
