%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# The wheels need time to change direction, so a second back is less far than a second forwards.
for exercise in range(1, 6):
    tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 1)
    tank_drive.on_for_seconds(SpeedPercent(-50), SpeedPercent(-50), 1)
    say(str(exercise))
