%%sim_magic_preloaded -b Empty_Map -p
def side():
    tank_drive.on_for_seconds(SpeedPercent(25), SpeedPercent(25), 2)


def corner():
    tank_turn.on_for_rotations(-100, SpeedPercent(25), 1.6)


side()
corner()
side()
corner()
side()
corner()
side()
corner()
