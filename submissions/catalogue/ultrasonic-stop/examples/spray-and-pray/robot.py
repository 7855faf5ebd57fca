%%sim_magic_preloaded -b Empty_Map -o Central_post -x 100 -y 500
tank_drive.on(SpeedPercent(40), SpeedPercent(40))

while ultrasonic.distance_centimeters > 25:
    pass

tank_drive.off()
for end in ("done", "finished", "over", "stopped", "there", "arrived", "ready", "near", "here"):
    for begin in ("It is", "I am", "This is", "All", "Now", "We are", "The robot is", "That is", "He is"):
        say(begin + " " + end)
