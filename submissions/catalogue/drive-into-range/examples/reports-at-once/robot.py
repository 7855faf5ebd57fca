import time
import ev3dev2_glue as glue

# Nobody hears this.
print("PY::here")

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while ultrasonic.distance_centimeters > 95:
    pass

tank_drive.off()
time.sleep(0.5)
messages = glue.pyState()["messages"]
print("Answer:", messages[-1]["message"] if messages else "none")
