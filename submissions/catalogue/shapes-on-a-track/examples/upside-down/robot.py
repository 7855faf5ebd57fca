%%sim_magic_preloaded -b Simple_Shapes -x 100 -y 700
import time

# Slowly past the shapes, with a picture every 5 mm or so.
tank_drive.on(SpeedPercent(10), SpeedPercent(10))
for picture in range(80):
    print("IMG_DATA")
    time.sleep(0.1)
tank_drive.off()
time.sleep(0.5)
