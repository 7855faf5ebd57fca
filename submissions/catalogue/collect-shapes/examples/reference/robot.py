import time

tank_drive.on(4, 4)
while tank_drive.left_motor.position < 950:
    # A sixth of the left sensor's picture is black where a shape is wholly in it.
    if colorLeft.reflected_light_intensity < 225:
        print("image_data both")
    time.sleep(0.03)
tank_drive.off()
