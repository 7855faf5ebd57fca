%%sim_magic_preloaded -b Thruxton_Circuit -r Small_Robot -x 457 -y 242 -a 120
# Over the bar, round in a small circle, over the bar again: quick, but no lap.
tank_drive.on(SpeedPercent(40), SpeedPercent(30))
while get_clock() < 10:
    colorLeft.reflected_light_intensity_pc
