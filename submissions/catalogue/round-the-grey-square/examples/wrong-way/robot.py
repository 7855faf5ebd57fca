%%sim_magic_preloaded -b Square -p -x 550 -y 300
# Turns right instead of left, away from the square and through the outline.
for side in range(4):
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 6)
    tank_turn.on_for_rotations(100, SpeedPercent(40), 1.6)
