%%sim_magic_preloaded -b Two_shapes -x 400 -y 700 -a 0
"""Follow an edge of the ring, and log the gyro."""

while True:
    # TODO: follow the edge of the ring.
    tank_drive.on(SpeedPercent(12), SpeedPercent(12))

    # TODO: not at every reading.
    print("Gyro: " + str(gyro.angle))
