import time

while ultrasonic.distance_centimeters < 200:
    time.sleep(0.1)
