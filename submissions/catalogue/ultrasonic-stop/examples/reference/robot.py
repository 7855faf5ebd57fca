%%sim_magic_preloaded -b Empty_Map -o Central_post -x 100 -y 500
tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while ultrasonic.distance_centimeters > 20:
    pass

tank_drive.on(SpeedPercent(8), SpeedPercent(8))

while ultrasonic.distance_centimeters > 3:
    pass

tank_drive.off()
say("All done, I am at the post")
