%%sim_magic_preloaded -b MNIST_Digits -x 100 -y 50 -a 90
# Meant to go to the next digit; but the robot is there already, and a turn of a wheel is no 100 mm.
tank_drive.on_for_rotations(SpeedPercent(20), SpeedPercent(20), 1)
print("image_data left")
