%%sim_magic_preloaded -b Empty_Map -o Central_post -x 100 -y 500
# Drive to the post, slow down, stop at most 3 cm from it, and say so.

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

# TODO: how far is it? (ultrasonic.distance_centimeters)

tank_drive.off()
say("All done")
