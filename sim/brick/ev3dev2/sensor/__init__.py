"""Sensor ports: ultrasonic in 1, left and right light in 2 and 3, gyro in 4."""

INPUT_1 = "in1"
INPUT_2 = "in2"
INPUT_3 = "in3"
INPUT_4 = "in4"
