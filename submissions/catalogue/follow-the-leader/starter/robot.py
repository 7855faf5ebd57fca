while True:
    # How far away is the other robot, and how quickly should this one drive?
    print(ultrasonic.distance_centimeters)
