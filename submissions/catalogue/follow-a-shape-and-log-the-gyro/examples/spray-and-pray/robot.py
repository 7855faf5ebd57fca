%%sim_magic_preloaded -b Two_shapes -x 400 -y 700 -a 0
import time

for sample in range(30):
    for guess in range(-90, 91, 10):
        print("Gyro: " + str(guess))
    time.sleep(0.5)
