%%sim_magic_preloaded -b Thruxton_Circuit -r Small_Robot -x 457 -y 242 -a 120
"""One lap of the circuit, as fast as you can."""

while True:
    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc

    # TODO: steer towards the darker side, and find out how fast you can go.
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
