%%sim_magic_preloaded -b Empty_Map -o Central_post -x 100 -y 500
import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))
distance = ultrasonic.distance_centimeters
while distance > 2:
    if distance < 30:
        tank_drive.on(SpeedPercent(6), SpeedPercent(6))
    distance = ultrasonic.distance_centimeters
tank_drive.off()
say("All done")
