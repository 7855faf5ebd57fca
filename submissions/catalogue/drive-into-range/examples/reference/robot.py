import time
import ev3dev2_glue as glue

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

# 500 mm from the beacon it is 1062 mm to the wall, less the 20 mm that the sensor sits in front.
while ultrasonic.distance_centimeters > 95:
    pass

tank_drive.off()
print("PY::here")
time.sleep(0.5)
print("Answer:", glue.pyState()["messages"][-1]["message"])
